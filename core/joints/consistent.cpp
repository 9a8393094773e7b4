#include "joints/consistent.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <numeric>
#include <vector>

#include "linalg/factorization.hpp"
#include "linalg/symmetric_eigen.hpp"

namespace fclib {

namespace {

/// Half the last digit of single precision.
constexpr double single_precision = 0x1p-24;
/// The range of a precision that a problem may state; outside it the statement is ignored. Below
/// `finest`, the squares in R are rounding. Above `coarsest` (half precision), any contradiction
/// could hide.
constexpr double finest = 4e-9;
constexpr double coarsest = 0x1p-11;
/// Roundings of a row: about twelve entries (two bodies with six velocities), their sum, and b.
constexpr double roundings = 16;
/// A combination contradicts only if what is left of it, over the terms of b, is more than this.
constexpr double agreement = 1e-9;
/// Eigenvalues are computed only for loops of at most so many rows.
constexpr std::size_t most_rows = 2000;
/// A number of at most so many bits may be meant exactly, as 0.5 is: half of the bits of a float.
constexpr int short_bits = 12;

/// "precision": NUMBER in the description. 0 if it is not there.
double stated_precision(const std::string& description) {
  static const std::string key = "\"precision\":";
  const std::size_t at = description.find(key);
  if (at == std::string::npos) return 0;
  const double value = std::strtod(description.c_str() + at + key.size(), nullptr);
  return value >= finest && value <= coarsest ? value : 0;
}

/// Whether all entries are floats, and some have more digits than a person writes by hand.
bool is_single(const Matrix& a) {
  bool all = true;
  bool long_one = false;
  for_each_entry(a, [&](Index, Index, double value) {
    all = all && static_cast<double>(static_cast<float>(value)) == value;
    int exponent = 0;
    const double bits = std::ldexp(std::frexp(value, &exponent), short_bits);
    long_one = long_one || bits != std::floor(bits);
  });
  return all && long_one;
}

/// The groups of rows that are coupled in R: one group for each loop.
std::vector<std::vector<Index>> loops(const SparseColumns& r) {
  std::vector<Index> above(static_cast<std::size_t>(r.cols()));
  std::iota(above.begin(), above.end(), Index{0});
  const auto first = [&](Index row) {
    while (above[static_cast<std::size_t>(row)] != row) {
      Index& next = above[static_cast<std::size_t>(row)];
      row = next = above[static_cast<std::size_t>(next)];
    }
    return row;
  };
  for (Eigen::Index col = 0; col < r.cols(); ++col) {
    for (SparseColumns::InnerIterator entry(r, col); entry; ++entry) {
      if (entry.value() == 0) continue;
      const auto [low, high] =
          std::minmax({first(static_cast<Index>(entry.row())), first(static_cast<Index>(col))});
      above[static_cast<std::size_t>(high)] = low;
    }
  }
  std::map<Index, std::vector<Index>> parts;
  for (Index row = 0; row < static_cast<Index>(r.cols()); ++row) parts[first(row)].push_back(row);
  std::vector<std::vector<Index>> result;
  for (auto& [_, rows] : parts) result.push_back(std::move(rows));
  return result;
}

/// The norm, in M's metric up to its diagonal, of the part of a velocity that these rows see.
double felt(const SparseColumns& g, const std::vector<Index>& rows, const Vector& inertia,
            const Vector& velocity) {
  std::vector<char> feels(static_cast<std::size_t>(g.rows()), 0);
  for (const Index row : rows) {
    for (SparseColumns::InnerIterator entry(g, row); entry; ++entry) {
      if (entry.value() != 0) feels[static_cast<std::size_t>(entry.row())] = 1;
    }
  }
  double squares = 0;
  for (Eigen::Index k = 0; k < velocity.size(); ++k) {
    if (feels[static_cast<std::size_t>(k)] != 0) squares += inertia[k] * velocity[k] * velocity[k];
  }
  return std::sqrt(squares);
}

/// The rows and columns with these numbers.
Eigen::MatrixXd block(const SparseColumns& a, const std::vector<Index>& numbers) {
  std::vector<Index> place(static_cast<std::size_t>(a.rows()), -1);
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    place[static_cast<std::size_t>(numbers[k])] = static_cast<Index>(k);
  }
  const auto size = static_cast<Eigen::Index>(numbers.size());
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index k = 0; k < size; ++k) {
    for (SparseColumns::InnerIterator entry(a, numbers[static_cast<std::size_t>(k)]); entry;
         ++entry) {
      const Index row = place[static_cast<std::size_t>(entry.row())];
      if (row >= 0) result(row, k) = entry.value();
    }
  }
  return result;
}

}  // namespace

std::optional<ConsistentJoints> consistent_joints(const GlobalProblem& problem) {
  if (!is_mixed(problem)) return std::nullopt;
  ConsistentJoints result;
  result.precision = stated_precision(problem.info.description);
  result.stated = result.precision > 0;
  if (!result.stated) {
    if (!is_single(problem.G)) return std::nullopt;
    result.precision = single_precision;
  }
  const double unit = roundings * result.precision;
  const Factorization mass(to_eigen(problem.M), "M");
  const SparseColumns g = to_eigen(problem.G);
  const SparseColumns r = mass.gram(g);
  const Vector velocity = mass.solve(problem.f);
  const Vector inertia = to_eigen(problem.M).diagonal().cwiseAbs();
  const Vector lengths = Vector(r.diagonal()).cwiseMax(0.0).cwiseSqrt();
  result.b = problem.b;
  SparseColumns change(g.rows(), g.cols());
  bool contradicts = false;
  for (const std::vector<Index>& rows : loops(r)) {
    const auto size = static_cast<Eigen::Index>(rows.size());
    if (rows.size() > most_rows) continue;
    Vector length(size);
    Vector b(size);
    for (Eigen::Index k = 0; k < size; ++k) {
      const Index row = rows[static_cast<std::size_t>(k)];
      length[k] = lengths[row];
      b[k] = problem.b[row];
    }
    if (!(length.array() > 0).all()) continue;  // an empty row contradicts or says nothing
    const Vector scaled_b = b.cwiseQuotient(length);
    const Vector inverse = length.cwiseInverse();
    const Eigenpairs eigen =
        eigenpairs(inverse.asDiagonal() * block(r, rows) * inverse.asDiagonal());
    Eigen::Index idle = 0;
    while (idle < size && eigen.values[idle] <= unit * unit) ++idle;
    if (idle == 0) continue;
    const Eigen::MatrixXd z = eigen.vectors.leftCols(idle);
    const Vector contradiction = z.transpose() * scaled_b;
    const Vector terms = z.cwiseAbs().transpose() * scaled_b.cwiseAbs();
    if (!(contradiction.array().abs() > agreement * terms.array()).any()) continue;
    const double explained = unit * (felt(g, rows, inertia, velocity) + scaled_b.norm());
    if (!(contradiction.norm() <= explained)) return std::nullopt;
    contradicts = true;
    const Vector moved = length.cwiseProduct(z * contradiction);
    std::vector<Eigen::Triplet<double, Index>> entries;
    const Eigen::MatrixXd back = length.asDiagonal() * z;           // E^-1 Z
    const Eigen::MatrixXd along = inverse.asDiagonal() * z;         // E Z
    Eigen::MatrixXd image = Eigen::MatrixXd::Zero(g.rows(), idle);  // G E Z
    for (Eigen::Index k = 0; k < size; ++k) {
      const Index row = rows[static_cast<std::size_t>(k)];
      result.b[row] -= moved[k];
      result.moved = std::max(result.moved, std::abs(moved[k]));
      for (SparseColumns::InnerIterator entry(g, row); entry; ++entry) {
        image.row(entry.row()) += entry.value() * along.row(k);
      }
    }
    for (Eigen::Index dof = 0; dof < g.rows(); ++dof) {
      if (image.row(dof).isZero(0)) continue;
      for (Eigen::Index k = 0; k < size; ++k) {
        entries.emplace_back(static_cast<Index>(dof), rows[static_cast<std::size_t>(k)],
                             image.row(dof).dot(back.row(k)));
      }
    }
    SparseColumns own(g.rows(), g.cols());
    own.setFromTriplets(entries.begin(), entries.end());
    change += own;
  }
  if (!contradicts) return std::nullopt;
  result.G = Matrix::from_eigen(SparseColumns(g - change));
  return result;
}

std::string ConsistentJoints::words() const {
  char text[240];
  std::snprintf(text, sizeof text,
                "rows of joints contradict each other by up to %.2g m/s, which the %s precision of "
                "the data (%.1e) explains: they are made consistent, and judged so",
                moved, stated ? "stated" : "single", precision);
  return text;
}

}  // namespace fclib
