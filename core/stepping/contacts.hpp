// Which contacts a time step takes, and which contact of the step before each one continues.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stepping/columns.hpp"

namespace fclib::stepping {

/// The contacts within reach of a step, by the velocity law; nc contacts of d components.
struct Reach {
  int d = 3;
  Columns H;                           ///< (n x d nc)
  Columns M;                           ///< (n x n), no zero on its diagonal
  std::span<const double> v;           ///< (n) before the step
  std::span<const double> force;       ///< (n)
  std::span<const std::int64_t> pair;  ///< (nc x 2) shapes, the first one < 0 for a limit
  std::span<const double> point;       ///< (nc x 3) [m]
  std::span<const double> gap;         ///< (nc) [m]
  double h = 0;                        ///< step [s]
  bool allowance = false;              ///< whether gaps that rounding opens count as closed
  double rounding = 0;                 ///< how far each coordinate may be off [m], [rad]
  double motion = 0;                   ///< ... and the share of its free motion
  std::span<const double> surface;     ///< how far a shape's surface is off [m]; empty: exact
  double activation = 0;               ///< of points of a pair that touches [m]
  int face = 0;                        ///< largest number of points of a pair for `ends`
};

/// The active ones, in their order.
struct Active {
  std::vector<std::int64_t> which;
  std::vector<double> before;  ///< their normal velocity before the step [m/s]
  std::vector<double> closed;  ///< the gap that counts as closed [m]
  /// places in `which` of pairs with more points than `face`: all are kept
  std::vector<std::vector<std::int64_t>> crowded;
};

/// A contact is active if its gap in the middle of the step is closed, or at most `activation` in a
/// pair with such a contact. With the allowance, points between two others of their pair are left
/// out: reactions at these can replace theirs.
Active active_contacts(const Reach& reach);

/// Which of k points (k x 3) are not on a line between two others, within off (k).
std::vector<std::uint8_t> not_between(std::span<const double> points, std::span<const double> off);

/// The contact of the step before that each one continues; -1 for none.
///
/// If a pair of shapes has several, the nearest to each other are matched first. An edge or a
/// corner keeps its place on one of the shapes, so the smaller of two distances counts.
/// pair (nc x 2), place (nc x 2 x 3) on the two shapes. Throws Error (problem) if places are
/// missing.
std::vector<std::int64_t> same_contacts(std::span<const std::int64_t> old_pair,
                                        std::span<const double> old_place,
                                        std::span<const std::int64_t> pair,
                                        std::span<const double> place);

/// Reactions of another step in the frames of the contacts that continue them, by way of the world:
/// (nc x d) of each contact, 0 without a source. A limit has no frame, and keeps its components.
///
/// r (. x d), source (nc), frames (. x 3 x 3) N, T1, T2 in rows
/// force   the first components, which are along the first axes; the others are moments
/// axis    the axis of the first moment
std::vector<double> carried_over(std::span<const double> r, std::size_t d,
                                 std::span<const std::int64_t> source,
                                 std::span<const double> old_frame, std::span<const double> frame,
                                 std::size_t force, std::size_t axis);

/// Points (nc x 3) in the frames of their two shapes (nc x 2 x 3) [m]; 0 for limits.
///
/// place (shapes x 3), turn (shapes x 3 x 3)
/// period  along x and y [m], 0: none; a point is taken at its image nearest to the shape
void places_on_shapes(std::span<const double> point, std::span<const std::int64_t> pair,
                      std::span<const double> place, std::span<const double> turn,
                      const std::array<double, 2>& period, std::span<double> found);

}  // namespace fclib::stepping
