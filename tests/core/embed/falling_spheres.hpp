// Thirty spheres that fall into a heap on a plane, between walls: a simulation of a page.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "problems/local.hpp"
#include "random_data.hpp"

namespace fclib::testing {

class FallingSpheres {
 public:
  static constexpr int count = 30;
  static constexpr double step = 2e-3;

  FallingSpheres() {
    RandomData random(1);
    for (int k = 0; k < count; ++k) {
      x_.emplace_back(
          Eigen::Vector3d(0.22 * (k % 3) - 0.22, 0.22 * (k / 3 % 3) - 0.22, 0.12 + 0.21 * (k / 9)) +
          0.01 * Eigen::Vector3d(random.vector(3)));
    }
    v_ = Vector::Zero(6 * count);
  }

  /// The problem of this step, and names for its contacts.
  const LocalProblem& problem() {
    names.clear();
    std::vector<Eigen::Triplet<double, Index>> entries;
    const auto add = [&](int a, int b, const Eigen::Vector3d& normal, std::int64_t name) {
      Eigen::Vector3d t = normal.unitOrthogonal();
      const Eigen::Vector3d axes[3] = {normal, t, normal.cross(t)};
      const auto first = static_cast<Index>(3 * names.size());
      for (int k = 0; k < 3; ++k) {
        // the point of contact lies at -radius normal of a, and +radius normal of b
        const Eigen::Vector3d arm = (-radius * normal).cross(axes[k]);
        for (int j = 0; j < 3; ++j) {
          entries.emplace_back(6 * a + j, first + k, axes[k][j]);
          entries.emplace_back(6 * a + 3 + j, first + k, arm[j]);
          if (b >= 0) entries.emplace_back(6 * b + j, first + k, -axes[k][j]);
          if (b >= 0) entries.emplace_back(6 * b + 3 + j, first + k, arm[j]);
        }
      }
      names.push_back(name);
    };
    for (int a = 0; a < count; ++a) {
      const Eigen::Vector3d& x = x_[static_cast<std::size_t>(a)];
      if (x[2] < radius) add(a, -1, Eigen::Vector3d::UnitZ(), 64 * a + 63);
      for (int k = 0; k < 2; ++k) {
        const double side = x[k] > 0 ? 1 : -1;
        if (side * x[k] > 0.35 - radius)
          add(a, -1, -side * Eigen::Vector3d::Unit(k), 64 * a + 60 + k);
      }
      for (int b = 0; b < a; ++b) {
        const Eigen::Vector3d apart = x - x_[static_cast<std::size_t>(b)];
        if (apart.norm() < 2 * radius) add(a, b, apart.normalized(), 64 * a + b);
      }
    }
    H_ = SparseColumns(6 * count, static_cast<Eigen::Index>(3 * names.size()));
    H_.setFromTriplets(entries.begin(), entries.end());
    inverse_ = Vector::Ones(6 * count);
    for (int a = 0; a < count; ++a) {
      inverse_.segment<3>(6 * a + 3).setConstant(2.5 / (radius * radius));
      v_[6 * a + 2] -= 9.81 * step;
    }
    const SparseColumns W = H_.transpose() * inverse_.asDiagonal() * H_;
    problem_.W = Matrix::from_eigen(W);
    problem_.q = H_.transpose() * v_;
    problem_.mu = Vector::Constant(static_cast<Eigen::Index>(names.size()), 0.4);
    return problem_;
  }

  /// The next state.
  void move(const Vector& r) {
    v_ += inverse_.cwiseProduct(H_ * r);
    for (int a = 0; a < count; ++a) x_[static_cast<std::size_t>(a)] += step * v_.segment<3>(6 * a);
  }

  std::vector<std::int64_t> names;

 private:
  static constexpr double radius = 0.1;
  std::vector<Eigen::Vector3d> x_;
  Vector v_, inverse_;
  SparseColumns H_;
  LocalProblem problem_;
};

}  // namespace fclib::testing
