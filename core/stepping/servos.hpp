// Forces of actuators with feedback of their own length and speed, and the limits of these forces.
//
// A servo's force is linear in q and v, and taken at the end of the step. So it acts as a spring
// and a damper. If it reaches a limit it is a constant force, without stiffness and damping:
//
//   f = clip(f_0 - kp (l' - l) - kv (l'_t - l_t))     l, l_t   length and speed, l', l'_t at the
//   end
//
// The motion without contacts decides which servos are at a limit at the end of the step.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "linalg/matrix.hpp"
#include "stepping/columns.hpp"

namespace fclib::stepping {

/// The moments of k outputs: lengths' derivatives by n coordinates, output after output.
struct Moments {
  std::span<const std::int32_t> start;   ///< (k)
  std::span<const std::int32_t> length;  ///< (k)
  std::span<const std::int32_t> column;
  std::span<const double> value;
};

/// Outputs whose sum has a limit.
struct Tendon {
  std::vector<std::size_t> outputs;
  double low = 0, high = 0;
};

struct Servos {
  std::span<const double> stiffness, damping;     ///< (k) kp, kv
  std::span<const double> low, high;              ///< (k) limits of each output
  std::span<const double> joint_low, joint_high;  ///< (n) limits of the sum in a joint
  std::vector<Tendon> tendons;
  std::span<const double> springs, dampers;  ///< (n) of the joints themselves
};

/// The outputs and joints at a limit, and the resulting forces, all within their limits.
struct Held {
  std::vector<std::uint8_t> outputs;  ///< (k)
  std::vector<std::uint8_t> joints;   ///< (n)
  std::vector<double> force;          ///< (k)
  std::vector<double> joint_force;    ///< (n)
};

/// Damping and stiffness (n x n) of joints, and of servos at no limit: symmetric, semidefinite.
struct Linear {
  Matrix C, K;
};
Linear linear_of(const Servos& servos, const Moments& moments, const Held* held = nullptr);

struct Limited {
  std::vector<double> force;  ///< (n) of all actuators in the step
  Linear linear;
};

/// Throws Error (unsuitable) if M + h C + h^2 K is not positive definite.
///
/// raw     (k) forces at the start of the step, without limits
/// whole   (n) the same on the joints, with other forces of actuators
/// other   (n) all other forces
/// v       (n) velocities
Limited within_limits(const Servos& servos, const Moments& moments, std::span<const double> raw,
                      std::span<const double> whole, const Columns& M,
                      std::span<const double> other, std::span<const double> v, double h);

}  // namespace fclib::stepping
