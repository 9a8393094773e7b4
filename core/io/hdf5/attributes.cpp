#include "io/hdf5/attributes.hpp"

#include <optional>
#include <vector>

#include "io/hdf5/contents.hpp"
#include "io/hdf5/open.hpp"
#include "io/hdf5/transaction.hpp"

namespace fclib {

using namespace hdf5;

namespace {

/// The path of a group that has attributes, by its short name.
std::string group_with_attributes(const Group& root, std::string_view name) {
  if (name == "solution" || name.starts_with("guesses/")) return std::string(name);
  if (name == "info") return "fclib_" + owner_of(root) + "/info";
  throw Error(ErrorKind::option,
              "there is no group '" + std::string(name) +
                  "'; there are: solution, info, guesses/1, guesses/2, ...",
              "group");
}

/// Whether a path of one or two names exists.
bool has_group(const Group& root, const std::string& path) {
  return root.has(path.substr(0, path.find('/'))) && root.has(path);
}

std::string path_of(const Group& group, const std::string& attribute) {
  return group.path + ", attribute " + attribute;
}

/// Removes an attribute that is there already, or throws.
void make_room_for(const Group& group, const std::string& attribute, bool replace) {
  if (H5Aexists(group.id, attribute.c_str()) <= 0) return;
  const std::string where = path_of(group, attribute);
  if (!replace) fail(where, "is in the file already, and is not to be replaced");
  check(H5Adelete(group.id, attribute.c_str()), where);
}

herr_t add_name(hid_t, const char* name, const H5A_info_t*, void* names) {
  static_cast<std::vector<std::string>*>(names)->emplace_back(name);
  return 0;
}

/// An attribute that is one number or one text of fixed length, or nothing.
std::optional<std::variant<double, std::string>> read_attribute(hid_t group,
                                                                const std::string& name) {
  const Handle attribute(H5Aopen(group, name.c_str(), H5P_DEFAULT), H5Aclose);
  if (!attribute.ok()) return std::nullopt;
  const Handle space(H5Aget_space(attribute.id()), H5Sclose);
  const Handle type(H5Aget_type(attribute.id()), H5Tclose);
  if (H5Sget_simple_extent_npoints(space.id()) != 1) return std::nullopt;
  const H5T_class_t kind = H5Tget_class(type.id());
  if (kind == H5T_INTEGER || kind == H5T_FLOAT) {
    double value = 0;
    if (H5Aread(attribute.id(), H5T_NATIVE_DOUBLE, &value) < 0) return std::nullopt;
    return value;
  }
  // attributes lie in the header of their group, which has at most 64 kB
  constexpr std::size_t longest = std::size_t{1} << 16;
  const std::size_t size = H5Tget_size(type.id());
  if (kind != H5T_STRING || H5Tis_variable_str(type.id()) > 0 || size > longest) {
    return std::nullopt;
  }
  std::string text(size, '\0');
  if (H5Aread(attribute.id(), type.id(), text.data()) < 0) return std::nullopt;
  return text.substr(0, text.find('\0'));
}

/// A new attribute of one integer: an array of one number, as libfclib 3.1 writes it.
void write_int(const Group& group, const std::string& name, Index value) {
  const hsize_t extent = 1;
  const Handle space(H5Screate_simple(1, &extent, nullptr), H5Sclose);
  write_attribute(group, name.c_str(), H5T_STD_I32LE, space, H5T_NATIVE_INT32, &value);
}

}  // namespace

Attributes read_attributes(const std::string& path, std::string_view group) {
  return read_from(path, [&](const Group& root) {
    const std::string name = group_with_attributes(root, group);
    Attributes result;
    if (!has_group(root, name)) return result;
    const Handle handle = open_group(root, name);
    std::vector<std::string> names;
    H5Aiterate2(handle.id(), H5_INDEX_NAME, H5_ITER_INC, nullptr, add_name, &names);
    for (const std::string& key : names) {
      if (const auto value = read_attribute(handle.id(), key)) result[key] = *value;
    }
    return result;
  });
}

void write_attributes(const std::string& path, std::string_view group,
                      const Attributes& attributes) {
  change_file(path, Start::existing, WriteOptions{}.compression, [&](const Target& root) {
    const std::string name = group_with_attributes(root, group);
    const bool there = has_group(root, name);
    const bool made = group == "info" && !there;
    const Handle handle = made ? create_group(root, name) : open_group(root, name);
    const Group target{handle.id(), root.child(name)};
    for (const auto& [key, value] : attributes) {
      make_room_for(target, key, true);
      if (const auto* text = std::get_if<std::string>(&value)) {
        write_text_attribute(target, key.c_str(), *text);
      } else {
        write_number_attribute(target, key.c_str(), std::get<double>(value));
      }
    }
  });
}

void write_int_attribute(const std::string& path, const std::string& name, Index value,
                         const WriteOptions& options) {
  change_file(path, Start::existing, options.compression, [&](const Target& root) {
    const std::string problem = "fclib_" + owner_of(root, "local");
    const Handle parent = open_group(root, problem);
    const Target group{{parent.id(), root.child(problem)}, root.style};
    const Handle handle =
        group.has("info") ? open_group(group, "info") : create_group(group, "info");
    const Group info{handle.id(), group.child("info")};
    make_room_for(info, name, options.replace);
    write_int(info, name, value);
  });
}

}  // namespace fclib
