#include "io/hdf5/geometry_groups.hpp"

#include <utility>

#include "io/hdf5/read_objects.hpp"

namespace fclib::hdf5 {

namespace {

bool is_ours(const Group& root, const std::string& name) {
  if (!root.has(name)) return false;
  const Handle group(H5Gopen2(root.id, name.c_str(), H5P_DEFAULT), H5Gclose);
  if (!group.ok() || H5Aexists(group.id(), geometry_mark) <= 0) return false;
  const Handle attribute(H5Aopen(group.id(), geometry_mark, H5P_DEFAULT), H5Aclose);
  const Handle type(H5Aget_type(attribute.id()), H5Tclose);
  const std::string_view expected(geometry_layout);
  if (H5Tget_class(type.id()) != H5T_STRING || H5Tis_variable_str(type.id()) > 0 ||
      H5Tget_size(type.id()) != expected.size() + 1) {
    return false;
  }
  std::string text(expected.size() + 1, '\0');
  return H5Aread(attribute.id(), type.id(), text.data()) >= 0 && text.c_str() == expected;
}

std::vector<std::string> names_of(const Group& group) {
  std::vector<std::string> names;
  H5G_info_t info;
  if (H5Gget_info(group.id, &info) < 0) fail(group.path, "cannot be read");
  for (hsize_t k = 0; k < info.nlinks; ++k) {
    const auto name = [&](char* text, std::size_t size) {
      return H5Lget_name_by_idx(group.id, ".", H5_INDEX_NAME, H5_ITER_INC, k, text, size,
                                H5P_DEFAULT);
    };
    const ssize_t length = name(nullptr, 0);
    if (length < 0) fail(group.path, "cannot be read");
    std::string text(static_cast<std::size_t>(length) + 1, '\0');
    name(text.data(), text.size());
    text.pop_back();
    names.push_back(std::move(text));
  }
  return names;
}

H5T_class_t class_of(const Group& group, const std::string& name) {
  if (!group.has(name)) fail(group.child(name), "the dataset is missing");
  const Handle dataset(H5Dopen2(group.id, name.c_str(), H5P_DEFAULT), H5Dclose);
  if (!dataset.ok()) fail(group.child(name), "is not a dataset that HDF5 can open");
  const Handle type(H5Dget_type(dataset.id()), H5Tclose);
  return H5Tget_class(type.id());
}

Geometry::Table read_table(const Group& group) {
  Geometry::Table table;
  for (const std::string& name : names_of(group)) {
    const H5T_class_t kind = class_of(group, name);
    if (kind == H5T_INTEGER) {
      table[name] = read_indices<std::vector<std::int32_t>>(group, name);
    } else if (kind == H5T_FLOAT) {
      table[name] = read_doubles<std::vector<double>>(group, name);
    } else if (kind == H5T_STRING) {
      table[name] = read_text(group, name);
    }
  }
  return table;
}

}  // namespace

GeometryPointer read_geometry(const Group& root) {
  std::shared_ptr<Geometry> geometry;
  Geometry::for_each_table([&](std::string_view view, Geometry::Table Geometry::* member) {
    const std::string name(view);
    if (!is_ours(root, name)) return;
    if (!geometry) geometry = std::make_shared<Geometry>();
    const Handle handle = open_group(root, name);
    (*geometry).*member = read_table({handle.id(), root.child(name)});
  });
  return geometry;
}

void remove_geometry(const Group& root) {
  Geometry::for_each_table([&](std::string_view view, Geometry::Table Geometry::*) {
    const std::string name(view);
    if (is_ours(root, name)) {
      check(H5Ldelete(root.id, name.c_str(), H5P_DEFAULT), root.child(name));
    }
  });
}

void write_geometry(const Target& root, const Geometry& geometry) {
  Geometry::for_each_table([&](std::string_view view, Geometry::Table Geometry::* member) {
    const Geometry::Table& table = geometry.*member;
    if (table.empty()) return;
    const std::string name(view);
    if (root.has(name)) fail(root.child(name), "is in the file already, and is not ours");
    const NewGroup group(root, name);
    write_text_attribute(group.target(), geometry_mark, geometry_layout);
    for (const auto& column : table) {
      const std::string& key = column.first;
      std::visit(
          [&]<class Values>(const Values& values) {
            if constexpr (std::is_same_v<Values, std::string>) {
              write_text(group.target(), key, values);
            } else {
              write_numbers(group.target(), key, values);
            }
          },
          column.second);
    }
  });
}

}  // namespace fclib::hdf5
