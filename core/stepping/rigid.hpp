// Contacts of rigid bodies, from the arrays of MuJoCo's data.
//
// Three rows of its constraint Jacobian are N, T1, T2 of a contact, and those of spin and rolling
// follow. They become the columns of H, without explicit zeros. A limit of a joint or a tendon is a
// contact without friction, whose row is N; limits come after the contacts.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "linalg/matrix.hpp"

namespace fclib::stepping {

/// A table whose rows lie at equal distances.
template <class Number>
struct Table {
  const Number* data = nullptr;
  std::ptrdiff_t step = 0;  ///< from row to row, in numbers

  const Number* operator[](std::size_t row) const {
    return data + static_cast<std::ptrdiff_t>(row) * step;
  }
};

/// The rows of the Jacobian, one after the other.
struct Rows {
  Index columns = 0;  ///< degrees of freedom
  std::span<const std::int32_t> length;
  std::span<const std::int32_t> column;
  std::span<const double> value;
};

struct Detected {
  std::size_t count = 0;
  Table<std::int32_t> address;  ///< of the first row, < 0: none
  Table<std::int32_t> shape;    ///< two shapes, < 0 for other things than geometries
  Table<std::int32_t> dim;      ///< 3, 4 with spin, 6 with rolling too
  Table<double> friction;       ///< two of sliding, one of spin, two of rolling
  Table<double> gap;            ///< [m]
  Table<double> point;          ///< [m]
  Table<double> frame;          ///< N, T1, T2
};

/// Rows `first` and later are limits.
struct Limits {
  std::size_t first = 0, count = 0;
  std::span<const std::int32_t> kind;    ///< of all rows
  std::span<const std::int32_t> number;  ///< of the joint or tendon, of all rows
  std::span<const double> gap;           ///< of all rows
};

/// A row for each contact; 0 for what a limit has not.
struct ContactTable {
  Matrix H;
  std::vector<std::int64_t> pair;    ///< two shapes; of a limit -1 - kind, and its number
  std::vector<double> point, frame;  ///< (3), (3 x 3)
  std::vector<double> gap, mu, mu_r, mu_s;
};

struct Law {
  bool spin = false, rolling = false;
  double least = 0;  ///< smaller coefficients are 0
};

/// The contacts that give rows: all except those between bodies that cannot move.
ContactTable contacts_of(const Rows& rows, const Detected& contacts, const Limits& limits,
                         const Law& law);

/// The speed (geometries) [m/s] that no point of a geometry exceeds.
///
/// twist    (bodies x 6) angular velocity, and velocity at the centre of mass of the whole tree
/// body     (geometries) its body
/// centre   (bodies x 3) the tree's centre of mass
/// root     (geometries) the root of its tree
/// place    (geometries x 3)
/// radius   (geometries)
void speeds_of(std::span<const double> twist, std::span<const std::int64_t> body,
               std::span<const double> centre, std::span<const std::int64_t> root,
               std::span<const double> place, std::span<const double> radius,
               std::span<double> speed);

/// The margins within which contacts are found: of geometries the larger one of their own and their
/// reach, of bodies the largest one of their geometries.
struct Margins {
  std::span<double> geometry;  ///< (geometries) [m]
  std::span<double> body;      ///< (bodies) [m], 0 without geometries
};

/// own      (geometries) [m]
/// reach    (geometries) [m]
/// owner    the bodies that have geometries
/// first    of each of these its first geometry; those of a body follow each other
void set_margins(std::span<const double> own, std::span<const double> reach,
                 std::span<const std::int64_t> owner, std::span<const std::int64_t> first,
                 const Margins& margins);

}  // namespace fclib::stepping
