// fclib_write_geometry: the tables of docs/format.md from the caller's arrays.
#include "geometry.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "capi/errors.hpp"
#include "capi/from_c.hpp"
#include "capi/geometry_of_c.hpp"
#include "capi/options.hpp"
#include "capi/structs.hpp"
#include "io/hdf5/write.hpp"

namespace fclib::c {

namespace {

using Integers = std::vector<std::int32_t>;
using Numbers = std::vector<double>;

std::string place(const char* table, const char* column) {
  return std::string("/") + table + "/" + column;
}

/// Copies arrays into the columns of a table, and checks them on the way.
class Columns {
 public:
  Columns(const char* name, Geometry::Table& table) : name_(name), table_(table) {}

  /// If the array is NULL, `otherwise` is repeated. Without it, NULL is an error.
  const Integers& integers(const char* column, const int* values, std::size_t rows,
                           std::size_t width, int lowest, int count, Integers otherwise = {}) {
    Integers copied = copy(column, values, rows, width, otherwise);
    for (std::size_t k = 0; k < copied.size(); ++k) {
      if (copied[k] >= lowest && copied[k] < count) continue;
      if (count <= 0) {
        fail(place(name_, column) + "[" + std::to_string(k) + "]",
             "is " + std::to_string(copied[k]) + ", but there is none");
      }
      fail(place(name_, column) + "[" + std::to_string(k) + "]",
           "is " + std::to_string(copied[k]) + ", but must be " + std::to_string(lowest) + " to " +
               std::to_string(count - 1));
    }
    return put(column, std::move(copied));
  }

  const Numbers& numbers(const char* column, const double* values, std::size_t rows,
                         std::size_t width, const Numbers& otherwise = {}) {
    Numbers copied = copy(column, values, rows, width, otherwise);
    for (std::size_t k = 0; k < copied.size(); ++k) {
      if (!std::isfinite(copied[k])) {
        fail(place(name_, column) + "[" + std::to_string(k) + "]",
             "the value is not a finite number");
      }
    }
    return put(column, std::move(copied));
  }

  template <class Values>
  const Values& put(const char* column, Values values) {
    return std::get<Values>(table_[column] = std::move(values));
  }

 private:
  template <class Number>
  std::vector<Number> copy(const char* column, const Number* values, std::size_t rows,
                           std::size_t width, const std::vector<Number>& otherwise) const {
    std::vector<Number> copied;
    const std::size_t size = rows * width;
    if (values != nullptr) {
      copied.assign(values, values + size);
    } else if (size > 0) {
      if (otherwise.empty()) {
        fail(place(name_, column), "is NULL, but has " + std::to_string(size) + " entries");
      }
      while (copied.size() < size) {
        copied.insert(copied.end(), otherwise.begin(), otherwise.end());
      }
    }
    return copied;
  }

  const char* name_;
  Geometry::Table& table_;
};

const Numbers origin{0, 0, 0};
const Numbers not_turned{1, 0, 0, 0};

std::string names_of(const fclib_geometry& c, std::size_t bodies) {
  std::string lines;
  for (std::size_t k = 0; k < bodies; ++k) {
    const char* const given_name = c.name != nullptr ? c.name[k] : nullptr;
    const std::string name = given_name != nullptr ? given_name : std::to_string(k + 1);
    if (name.find('\n') != std::string::npos) {
      fail("/bodies/name", "name " + std::to_string(k) + " has more than one line");
    }
    lines += (k > 0 ? "\n" : "") + name;
  }
  return lines;
}

/// The meshes one after the other, each with its vertices and faces.
void copy_meshes(const fclib_geometry& c, std::size_t meshes, Columns& bodies) {
  constexpr int any = std::numeric_limits<int>::max();
  const Integers first = bodies.integers("mesh_first", c.mesh_first, meshes + 1, 2, 0, any);
  for (std::size_t k = 0; k < first.size(); ++k) {
    const int before = k < 2 ? 0 : first[k - 2];
    if (first[k] < before || (k < 2 && first[k] != 0)) {
      fail("/bodies/mesh_first[" + std::to_string(k) + "]",
           "is " + std::to_string(first[k]) + ": the numbers begin with 0 and do not decrease");
    }
  }
  const auto vertices = static_cast<std::size_t>(first[2 * meshes]);
  const auto faces = static_cast<std::size_t>(first[2 * meshes + 1]);
  bodies.numbers("vertex", c.vertex, vertices, 3);
  const Integers face = bodies.integers("face", c.face, faces, 4, -1, any);
  for (std::size_t mesh = 0; mesh < meshes; ++mesh) {
    const int count = first[2 * mesh + 2] - first[2 * mesh];
    for (auto k = 4 * static_cast<std::size_t>(first[2 * mesh + 1]);
         k < 4 * static_cast<std::size_t>(first[2 * mesh + 3]); ++k) {
      if (face[k] >= count || (face[k] < 0 && k % 4 != 3)) {
        fail("/bodies/face[" + std::to_string(k) + "]", "is " + std::to_string(face[k]) +
                                                            ", but the mesh has " +
                                                            std::to_string(count) + " vertices");
      }
    }
  }
  if (c.displacement != nullptr) bodies.numbers("displacement", c.displacement, vertices, 3);
}

/// Shape k belongs to body k.
Integers in_turn(std::size_t count) {
  Integers numbers(count);
  for (std::size_t k = 0; k < count; ++k) numbers[k] = static_cast<std::int32_t>(k);
  return numbers;
}

/// The first shape of each body of a contact.
Integers first_shapes(const Integers& body, const Integers& shape_body) {
  Integers shapes;
  for (const std::int32_t of : body) {
    std::size_t k = 0;
    while (k < shape_body.size() && shape_body[k] != of) ++k;
    if (k == shape_body.size()) {
      fail("/contacts/shape", "is NULL, but body " + std::to_string(of) + " has no shape");
    }
    shapes.push_back(static_cast<std::int32_t>(k));
  }
  return shapes;
}

/// Numbers the contacts of the same two shapes.
Integers features(const Integers& body, const Integers& shape) {
  std::map<std::array<std::int32_t, 4>, std::int32_t> seen;
  Integers numbers;
  for (std::size_t k = 0; k < body.size(); k += 2) {
    numbers.push_back(seen[{body[k], body[k + 1], shape[k], shape[k + 1]}]++);
  }
  return numbers;
}

Geometry geometry_of(const fclib_geometry& c) {
  const std::size_t contact_count = size_of(c.nc, "geometry->nc");
  const std::size_t body_count = size_of(c.nb, "geometry->nb");
  const std::size_t shape_count = size_of(c.ns, "geometry->ns");
  const std::size_t mesh_count = size_of(c.nm, "geometry->nm");
  Geometry geometry;
  Columns bodies("bodies", geometry.bodies);
  bodies.put("name", names_of(c, body_count));
  bodies.integers("moves", c.moves, body_count, 1, 0, 2);
  bodies.numbers("place", c.place, body_count, 3);
  bodies.numbers("turn", c.turn, body_count, 4, not_turned);
  const Integers shape_body =
      bodies.integers("shape_body", c.shape_body, shape_count, 1, 0, c.nb, in_turn(shape_count));
  const Integers kinds =
      bodies.integers("shape_kind", c.shape_kind, shape_count, 1, FCLIB_PLANE, FCLIB_MESH + 1);
  bodies.numbers("shape_size", c.shape_size, shape_count, 3);
  bodies.numbers("shape_place", c.shape_place, shape_count, 3, origin);
  bodies.numbers("shape_turn", c.shape_turn, shape_count, 4, not_turned);
  const Integers meshes =
      bodies.integers("shape_mesh", c.shape_mesh, shape_count, 1, -1, c.nm, {-1});
  for (std::size_t k = 0; k < shape_count; ++k) {
    if ((kinds[k] == FCLIB_MESH) != (meshes[k] >= 0)) {
      fail("/bodies/shape_mesh[" + std::to_string(k) + "]",
           "is " + std::to_string(meshes[k]) + ", but the shape is " +
               (kinds[k] == FCLIB_MESH ? "a mesh" : "no mesh"));
    }
  }
  if (mesh_count > 0) copy_meshes(c, mesh_count, bodies);
  if (c.period != nullptr) bodies.numbers("period", c.period, 2, 1);
  if (c.planar != 0) bodies.put("planar", Integers{1});
  if (c.unit != nullptr) bodies.put("unit", std::string(c.unit));
  if (c.mass_unit != nullptr) bodies.put("mass_unit", std::string(c.mass_unit));
  if (c.mass != nullptr) bodies.numbers("mass", c.mass, body_count, 1);
  if (c.inertia != nullptr) bodies.numbers("inertia", c.inertia, body_count, 3);
  if (c.center != nullptr) bodies.numbers("center", c.center, body_count, 3);
  if (c.axes != nullptr) bodies.numbers("axes", c.axes, body_count, 4);
  const std::size_t components = size_of(c.n, "geometry->n");
  if (c.velocity != nullptr) bodies.numbers("velocity", c.velocity, components, 1);
  if (c.impulse != nullptr) bodies.numbers("impulse", c.impulse, components, 1);

  Columns contacts("contacts", geometry.contacts);
  const Integers body = contacts.integers("body", c.body, contact_count, 2, 0, c.nb);
  const Integers shape =
      contacts.integers("shape", c.shape, contact_count, 2, -1, c.ns,
                        c.shape == nullptr ? first_shapes(body, shape_body) : Integers());
  contacts.integers("feature", c.feature, contact_count, 1, std::numeric_limits<int>::lowest(),
                    std::numeric_limits<int>::max(), features(body, shape));
  contacts.numbers("point", c.point, contact_count, 3);
  contacts.numbers("normal", c.normal, contact_count, 3);
  contacts.numbers("tangent", c.tangent, contact_count, 3);
  contacts.numbers("gap", c.gap, contact_count, 1, {0});
  return geometry;
}

int write(const fclib_geometry* geometry, const char* path, const fclib_options* options) {
  return guarded(0, [&] {
    write_geometry(&given(path, "path"), geometry_of_c(given(geometry, "geometry")),
                   write_options(options));
    return 1;
  });
}

}  // namespace

Geometry geometry_of_c(const fclib_geometry& geometry) {
  const std::size_t size = geometry.size;
  if (size < offsetof(fclib_geometry, mass_unit) + sizeof(char*)) {
    fail("geometry->size",
         "is " + std::to_string(size) + ", expected sizeof(struct fclib_geometry)");
  }
  fclib_geometry c{};
  std::memcpy(&c, &geometry, std::min(size, sizeof c));
  return geometry_of(c);
}

}  // namespace fclib::c

extern "C" {

int fclib_write_geometry(const fclib_geometry* geometry, const char* path) {
  return fclib::c::write(geometry, path, nullptr);
}

int fclib_write_geometry_with(const fclib_geometry* geometry, const char* path,
                              const fclib_options* options) {
  return fclib::c::write(geometry, path, options);
}

}  // extern "C"
