#include "proof/no_solution.hpp"

#include <algorithm>
#include <cmath>
#include <concepts>
#include <map>
#include <numeric>
#include <utility>
#include <vector>

#include "contact/laws.hpp"
#include "linalg/dependent_columns.hpp"
#include "linalg/exact_sum.hpp"

namespace fclib {

namespace {

using Dense = Eigen::MatrixXd;

constexpr double unit = 0x1p-53;
/// The rest of a sum in W may be so many times the rounding of its last digits.
constexpr double last_digits = 8;
/// A gain below this part of its terms is rounding.
constexpr double least_gain = 1e-8;
/// An exact proof must be this near, over the least part of the proof: a reader's tolerance.
constexpr double nearest = 1e-10;
/// A proof may have so many unknowns: a reader must be able to turn them into rational numbers.
constexpr Index most_rational = 60;
/// If there are more, the candidate is not changed to make the sums exact.
constexpr Index most_unknowns = 96;
constexpr Index most_rows = 4096;
constexpr int most_rays = 200;
constexpr int most_parts = 8;
constexpr double most_operations = 1e8;

/// Calls cone(row, unknown, value) for the sums that must be in K*, zero(row, unknown, value) for
/// those that must vanish; y are the first nc unknowns, z the others.
template <class Cone, class Zero>
void for_each_term(const LocalProblem& problem, const Cone& cone, const Zero& zero) {
  const Index d = problem.spacedim;
  const auto nc = static_cast<Index>(problem.mu.size());
  for_each_entry(problem.W, [&](Index row, Index col, double value) {
    if (row % d == 0) cone(col, row / d, -value);
  });
  for_each_entry(problem.V, [&](Index row, Index col, double value) {
    cone(row, nc + col, -value);
    if (row % d == 0) zero(col, row / d, value);
  });
  for_each_entry(problem.R,
                 [&](Index row, Index col, double value) { zero(col, nc + row, value); });
}
template <class Cone, class Zero>
void for_each_term(const GlobalProblem& problem, const Cone& /*cone*/, const Zero& zero) {
  const Index d = problem.spacedim;
  const auto nc = static_cast<Index>(problem.mu.size());
  for_each_entry(problem.H, [&](Index row, Index col, double value) {
    if (col % d == 0) zero(row, col / d, value);
  });
  for_each_entry(problem.G,
                 [&](Index row, Index col, double value) { zero(row, nc + col, value); });
}

const Vector& normal_constants(const LocalProblem& problem) { return problem.q; }
const Vector& normal_constants(const GlobalProblem& problem) { return problem.w; }
const Vector& bilateral_constants(const LocalProblem& problem) { return problem.s; }
const Vector& bilateral_constants(const GlobalProblem& problem) { return problem.b; }

Index cone_rows(const LocalProblem& problem) { return static_cast<Index>(problem.q.size()); }
Index cone_rows(const GlobalProblem& /*problem*/) { return 0; }
Index zero_rows(const LocalProblem& problem) { return problem.size(Dim::p); }
Index zero_rows(const GlobalProblem& problem) { return problem.size(Dim::n); }

/// An upper bound for the part of a contact: its distance from K*. It is 0 only inside K*.
double distance_from_dual(Index d, const Friction& friction, const Vector& image, Index a) {
  // each part is off by at most two units, the norms and products by some more
  constexpr double more = 1 + 64 * unit;
  const double normal = image[d * a];
  double tangential = 0;  // the support function of the section of K
  bool resists = false;
  with_cone(static_cast<int>(d), friction, [&]<class Cone>() {
    const Cone cone(friction, a);
    typename Cone::Vec part = image.segment<Cone::dim>(d * a);
    part[0] = 0;
    tangential = cone.modified(part)[0];
    for (int g = 0; g < Cone::groups; ++g) resists = resists || cone.coefficient(g) > 0;
  });
  if (tangential == 0 && normal >= 0) {
    // a product that underflows is not zero
    const bool moves = (image.segment(d * a + 1, d - 1).array() != 0).any();
    if (!(moves && resists)) return 0;
  }
  if (normal > 0 && tangential > 1e-250 && normal >= more * tangential) return 0;
  const double outside = std::max(0.0, more * tangential - normal);
  const double size = image.segment(d * a, d).norm();
  return more * std::max(std::min(size, more * outside), 1e-300);
}

/// The parts of y that share no sum. The one with the largest gain comes first; those without a
/// gain are left out. If rows of bodies are squeezed side by side, each row is a proof of its own.
template <class P>
std::vector<Vector> separate_parts(const P& problem, const Vector& y) {
  const auto nc = static_cast<Index>(y.size());
  std::vector<Index> above(static_cast<std::size_t>(nc));  // the trees, one for each part
  std::iota(above.begin(), above.end(), 0);
  const auto root = [&](Index a) {
    while (above[static_cast<std::size_t>(a)] != a) a = above[static_cast<std::size_t>(a)];
    return a;
  };
  const Index shift = cone_rows(problem);
  std::vector<Index> first(static_cast<std::size_t>(shift + zero_rows(problem)), -1);
  const auto join = [&](Index row, Index a, double value) {
    if (a >= nc || value == 0 || !(y[a] > 0)) return;
    Index& other = first[static_cast<std::size_t>(row)];
    if (other < 0) other = a;
    // the smaller number is the root, which keeps the trees low
    const auto [low, high] = std::minmax({root(a), root(other)});
    above[static_cast<std::size_t>(high)] = low;
    above[static_cast<std::size_t>(a)] = low;
    other = low;
  };
  for_each_term(problem, join,
                [&](Index row, Index a, double value) { join(shift + row, a, value); });
  struct Part {
    double gain = 0;
    Vector y;
  };
  std::map<Index, Part> parts;
  for (Index a = 0; a < nc; ++a) {
    if (!(y[a] > 0)) continue;
    Part& part = parts[root(a)];
    if (part.y.size() == 0) part.y = Vector::Zero(nc);
    part.y[a] = y[a];
    part.gain -= y[a] * normal_constants(problem)[problem.spacedim * a];
  }
  std::vector<Part> gaining;
  for (auto& [_, part] : parts) {
    if (part.gain > 0) gaining.push_back(std::move(part));
  }
  std::stable_sort(gaining.begin(), gaining.end(),
                   [](const Part& a, const Part& b) { return a.gain > b.gain; });
  std::vector<Vector> found;
  for (Part& part : gaining) found.push_back(std::move(part.y));
  return found;
}

/// The columns of those unknowns, dense. Rows without an entry are left out. Returns false if
/// entries were added up, since that rounds.
template <class P>
bool columns(const P& problem, const std::vector<Index>& place, Index count, Dense& all,
             Dense& zeros) {
  const Index shift = cone_rows(problem);
  std::vector<Index> row_of(static_cast<std::size_t>(shift + zero_rows(problem)), -1);
  Index rows = 0;
  const auto touch = [&](Index row, Index unknown, double value) {
    if (place[static_cast<std::size_t>(unknown)] < 0 || value == 0) return;
    Index& at = row_of[static_cast<std::size_t>(row)];
    if (at < 0) at = rows++;
  };
  for_each_term(
      problem, [&](Index row, Index k, double value) { touch(row, k, value); },
      [&](Index row, Index k, double value) { touch(shift + row, k, value); });
  if (rows > most_rows) rows = 0;
  all = Dense::Zero(rows, count);
  zeros = Dense::Zero(rows, count);
  if (rows == 0) return true;
  bool single = true;
  for_each_term(
      problem,
      [&](Index row, Index k, double value) {
        const Index column = place[static_cast<std::size_t>(k)];
        if (column >= 0 && value != 0) all(row_of[static_cast<std::size_t>(row)], column) += value;
      },
      [&](Index row, Index k, double value) {
        const Index column = place[static_cast<std::size_t>(k)];
        if (column < 0 || value == 0) return;
        const Index at = row_of[static_cast<std::size_t>(shift + row)];
        single = single && zeros(at, column) == 0;
        all(at, column) += value;
        zeros(at, column) += value;
      });
  return single;
}

/// The smallest denominator of a fraction that equals x up to rounding, by the continued fraction
/// of x. 0 if there is none below `most`.
double denominator(double x, double most) {
  const double rounding = 1e-11 * std::max(1.0, std::abs(x));
  double rest = x;
  double before = 0;
  double last = 1;
  while (last <= most) {
    if (std::abs(x * last - std::round(x * last)) <= rounding * last) return last;
    rest = 1 / (rest - std::floor(rest));
    before = std::exchange(last, std::floor(rest) * last + before);
  }
  return 0;
}

/// Whole numbers with the same ratios, or nothing.
Vector whole_numbers(const Vector& x) {
  constexpr double most = 1e7;
  const double largest = x.cwiseAbs().maxCoeff();
  if (!(largest > 0)) return {};
  double common = 1;
  for (const double one : x) {
    common *= denominator(one / largest * common, most / common);
    if (common == 0) return {};
  }
  return (x * (common / largest)).array().round();
}

/// How a candidate is judged: as it is, or also if an exact proof is next to it.
enum class Exactness { itself, neighbour };

template <class P>
NoSolution judge(const P& problem, const Vector& y, const Vector& z, Exactness /*exactness*/) {
  return check_no_solution(problem, y, z);
}
NoSolution judge(const GlobalProblem& problem, const Vector& y, const Vector& z,
                 Exactness exactness);

template <class P>
class Search {
 public:
  Search(const P& problem, const Vector& y, Exactness exactness)
      : problem_(problem), y_(y), exactness_(exactness) {}

  NoSolution run() {
    const auto nc = static_cast<Index>(y_.size());
    const Index p = problem_.size(Dim::p);
    if (p == 0 && exactness_ == Exactness::itself && tried(y_, {})) return best_;
    std::vector<Index> place(static_cast<std::size_t>(nc + p), -1);
    for (Index a = 0; a < nc; ++a) {
      if (y_[a] > 0) contacts_.push_back(a);
    }
    unknowns_ = static_cast<Index>(contacts_.size()) + p;
    if (contacts_.empty() || unknowns_ > most_unknowns) return best_;
    Index at = 0;
    for (const Index a : contacts_) place[static_cast<std::size_t>(a)] = at++;
    for (Index k = 0; k < p; ++k) place[static_cast<std::size_t>(nc + k)] = at++;
    columns(problem_, place, unknowns_, all_, zeros_);
    if (all_.rows() == 0 && (p > 0 || cone_rows(problem_) > 0)) return best_;
    const auto count = static_cast<Eigen::Index>(contacts_.size());
    Vector x = Vector::Zero(unknowns_);
    for (Eigen::Index k = 0; k < count; ++k) x[k] = y_[contacts_[static_cast<std::size_t>(k)]];
    if (p > 0) {
      // y as it is, with the z that satisfies the constraints
      const Vector rest = -zeros_.leftCols(count) * x.head(count);
      x.tail(p) = least_solution(zeros_.rightCols(p), rest);
      if (tried(x)) return best_;
    }
    std::vector<Index> active(contacts_.size());
    std::iota(active.begin(), active.end(), 0);
    reduce(x, active);
    return best_;
  }

 private:
  /// Whether x is a proof that holds for all reactions.
  bool tried(const Vector& x) {
    const auto count = static_cast<Eigen::Index>(contacts_.size());
    const auto unfolded = [&](const Vector& from) {
      Vector y = Vector::Zero(y_.size());
      for (Eigen::Index k = 0; k < count; ++k) {
        y[contacts_[static_cast<std::size_t>(k)]] = std::max(0.0, from[k]);
      }
      return y;
    };
    const Vector whole = exactness_ == Exactness::itself ? whole_numbers(x) : Vector();
    if (whole.size() > 0 && tried(unfolded(whole), whole.tail(unknowns_ - count))) return true;
    return tried(unfolded(x), x.tail(unknowns_ - count));
  }
  bool tried(const Vector& y, const Vector& z) {
    NoSolution found = judge(problem_, y, z, exactness_);
    if (found.bound > best_.bound) best_ = std::move(found);
    return best_.exact();
  }

  /// From x in the kernel to its rays with the fewest contacts, until one is a proof.
  bool reduce(const Vector& from, const std::vector<Index>& active) {
    const double cost = static_cast<double>(all_.rows()) * static_cast<double>(unknowns_) *
                        static_cast<double>(unknowns_);
    if (++visited_ > most_rays || visited_ * cost > most_operations + cost) return false;
    const auto count = static_cast<Eigen::Index>(active.size());
    const auto p = unknowns_ - static_cast<Eigen::Index>(contacts_.size());
    Dense part(all_.rows(), count + p);
    Vector x(count + p);
    for (Eigen::Index k = 0; k < count; ++k) {
      part.col(k) = all_.col(active[static_cast<std::size_t>(k)]);
      x[k] = from[active[static_cast<std::size_t>(k)]];
    }
    part.rightCols(p) = all_.rightCols(p);
    x.tail(p) = from.tail(p);
    const Dense basis = kernel(part);
    if (basis.cols() == 0) return false;
    x = projected(basis, x);
    const auto whole = [&](const Vector& own) {
      Vector result = Vector::Zero(unknowns_);
      for (Eigen::Index k = 0; k < count; ++k) result[active[static_cast<std::size_t>(k)]] = own[k];
      result.tail(p) = own.tail(p);
      return result;
    };
    if (tried(whole(x))) return true;
    // move along the kernel in the direction that changes y most, until a contact drops out
    Eigen::Index way = -1;
    double most = 1e-9;
    for (Eigen::Index k = 0; k < basis.cols(); ++k) {
      const Vector y = basis.col(k).head(count);
      if (!(y.norm() > 0)) continue;
      const Vector along = x.head(count);
      const double off = (y - along * (along.dot(y) / along.squaredNorm())).norm() / y.norm();
      if (off > most) {
        most = off;
        way = k;
      }
    }
    if (way < 0) return false;
    for (const double sign : {1.0, -1.0}) {
      const Vector step = sign * basis.col(way);
      double length = std::numeric_limits<double>::infinity();
      Eigen::Index leaving = -1;
      for (Eigen::Index k = 0; k < count; ++k) {
        if (step[k] < 0 && x[k] / -step[k] < length) {
          length = x[k] / -step[k];
          leaving = k;
        }
      }
      if (leaving < 0 || count == 1) continue;
      const Vector next = x + length * step;
      const double largest = next.head(count).maxCoeff();
      std::vector<Index> kept;
      for (Eigen::Index k = 0; k < count; ++k) {
        if (k != leaving && next[k] > 1e-12 * largest)
          kept.push_back(active[static_cast<std::size_t>(k)]);
      }
      if (!kept.empty() && reduce(whole(next), kept)) return true;
    }
    return false;
  }

  const P& problem_;
  const Vector& y_;
  Exactness exactness_;
  std::vector<Index> contacts_;
  Index unknowns_ = 0;
  Dense all_, zeros_;
  NoSolution best_;
  int visited_ = 0;
};

/// A proof near y, or near one of its parts.
template <class P>
NoSolution search(const P& problem, const Vector& y, Exactness exactness = Exactness::itself) {
  NoSolution best = Search<P>(problem, y, exactness).run();
  // bilateral constraints may link all the parts
  if (best.proven() || problem.size(Dim::p) > 0) return best;
  int tries = 0;
  for (const Vector& part : separate_parts(problem, y)) {
    if (++tries > most_parts || best.proven()) break;
    best = Search<P>(problem, part, exactness).run();
  }
  return best;
}

/// The sums of a proof and its gain, exactly. Returns whether y and z have the right form and a
/// gain.
template <class P>
bool sums(const P& problem, const Vector& y, const Vector& z, std::vector<ExactSum>& cone,
          std::vector<ExactSum>& zero, double& gain) {
  const auto nc = static_cast<Index>(problem.mu.size());
  const Index p = problem.size(Dim::p);
  const Index d = problem.spacedim;
  if (y.size() != nc || z.size() != p || !y.allFinite() || !z.allFinite()) return false;
  if ((y.array() < 0).any()) return false;
  ExactSum negative;
  double terms = 0;
  for (Index a = 0; a < nc; ++a) {
    const double q = normal_constants(problem)[d * a];
    negative.add_product(-y[a], q);
    terms += std::abs(y[a] * q);
  }
  for (Index k = 0; k < p; ++k) {
    negative.add_product(-z[k], bilateral_constants(problem)[k]);
    terms += std::abs(z[k] * bilateral_constants(problem)[k]);
  }
  gain = negative.value();
  if (!negative.exact() || !(gain > least_gain * terms)) return false;
  const auto factor = [&](Index unknown) { return unknown < nc ? y[unknown] : z[unknown - nc]; };
  cone.assign(static_cast<std::size_t>(cone_rows(problem)), {});
  zero.assign(static_cast<std::size_t>(zero_rows(problem)), {});
  for_each_term(
      problem,
      [&](Index row, Index k, double value) {
        cone[static_cast<std::size_t>(row)].add_product(value, factor(k));
      },
      [&](Index row, Index k, double value) {
        zero[static_cast<std::size_t>(row)].add_product(value, factor(k));
      });
  return std::all_of(cone.begin(), cone.end(), [](const ExactSum& sum) { return sum.exact(); });
}

bool vanish(const std::vector<ExactSum>& sums) {
  return std::all_of(sums.begin(), sums.end(), [](const ExactSum& sum) { return sum.zero(); });
}

/// An upper bound of the difference, in any entry, between x and some x* with A x* = 0 exactly. It
/// is infinite if no such x* is certain. A B differs from the identity by less than a half, so it
/// has an inverse, and x* = x - B (A B)^-1 A x. The bounds on sums of products are those of Higham,
/// "Accuracy and stability of numerical algorithms", 2002, section 3.1.
double distance_from_kernel(const Dense& A, const Vector& x) {
  const double infinity = std::numeric_limits<double>::infinity();
  if (A.rows() == 0 || A.rows() > A.cols()) return infinity;
  const double rounding = 4 * unit * static_cast<double>(A.cols() + A.rows());
  const auto largest_sum = [&](const Dense& a) {
    return a.cwiseAbs().rowwise().sum().maxCoeff() * (1 + rounding);
  };
  const Dense B = pseudo_inverse(A);
  Dense off = A * B;
  off.diagonal().array() -= 1;
  const Dense unsure = rounding * (A.cwiseAbs() * B.cwiseAbs());
  const double rest = largest_sum(off) + 2 * largest_sum(unsure) + rounding;
  if (!(rest < 0.5)) return infinity;
  double residual = 0;
  for (Eigen::Index row = 0; row < A.rows(); ++row) {
    ExactSum sum;
    for (Eigen::Index k = 0; k < A.cols(); ++k) sum.add_product(A(row, k), x[k]);
    if (!sum.exact()) return infinity;
    residual = std::max(residual, std::abs(sum.value()) * (1 + rounding));
  }
  return largest_sum(B) * residual / (1 - rest) * (1 + rounding);
}

/// Whether there is a proof near y and z, on the same contacts, whose sums vanish exactly. If
/// normals are at any angle, doubles are too coarse to write it down.
bool has_exact_neighbour(const GlobalProblem& problem, const Vector& y, const Vector& z,
                         double gain) {
  const auto nc = static_cast<Index>(y.size());
  const auto p = static_cast<Index>(z.size());
  std::vector<Index> place(static_cast<std::size_t>(nc + p), -1);
  Vector x(nc + p);
  double least = std::numeric_limits<double>::infinity();
  double constants = 0;
  double terms = 0;
  Index count = 0;
  const auto take = [&](Index unknown, double value, double constant) {
    place[static_cast<std::size_t>(unknown)] = count;
    x[count++] = value;
    constants += std::abs(constant);
    terms += std::abs(value * constant);
  };
  for (Index a = 0; a < nc; ++a) {
    if (!(y[a] > 0)) continue;
    least = std::min(least, y[a]);
    take(a, y[a], normal_constants(problem)[problem.spacedim * a]);
  }
  for (Index k = 0; k < p; ++k) take(nc + k, z[k], bilateral_constants(problem)[k]);
  if (count == 0 || count > most_rational) return false;
  x.conservativeResize(count);
  Dense all;
  Dense zeros;
  if (!columns(problem, place, count, all, zeros)) return false;
  const double distance = distance_from_kernel(zeros, x);
  return distance < nearest * least && gain - 2 * distance * constants > least_gain * terms;
}

NoSolution check_local(const LocalProblem& problem, const Friction& friction, const Vector& y,
                       const Vector& given) {
  const Vector z = given.size() > 0 ? given : Vector(Vector::Zero(problem.size(Dim::p)));
  std::vector<ExactSum> cone;
  std::vector<ExactSum> zero;
  double gain = 0;
  if (!sums(problem, y, z, cone, zero, gain) || !vanish(zero)) return {};
  if (!(gain > least_speed * problem.q.norm() * y.norm())) return {};
  const Index d = problem.spacedim;
  const auto nc = static_cast<Index>(problem.mu.size());
  Vector image(problem.q.size());
  for (Eigen::Index k = 0; k < image.size(); ++k)
    image[k] = cone[static_cast<std::size_t>(k)].value();
  Vector distance(nc);
  for (Index a = 0; a < nc; ++a) distance[a] = distance_from_dual(d, friction, image, a);
  const double infinity = std::numeric_limits<double>::infinity();
  if ((distance.array() == 0).all()) return {y, z, gain, 0, infinity};
  if (z.size() > 0) return {};
  // the rest must be the last digits of W, and must show that W is a rounded matrix
  Vector size = Vector::Zero(nc);
  for_each_term(
      problem, [&](Index row, Index k, double value) { size[row / d] += std::abs(value) * y[k]; },
      [](Index, Index, double) {});
  if (!(distance.array() <= last_digits * unit * size.array()).all()) return {};
  double curvature = 0;
  double terms = 0;
  for (Index a = 0; a < nc; ++a) {
    curvature -= y[a] * image[d * a];
    terms += std::abs(y[a] * image[d * a]);
  }
  if (!(curvature < -16 * unit * static_cast<double>(nc) * terms)) return {};
  const double all = distance.norm() * (1 + 64 * unit * static_cast<double>(nc));
  return {y, z, gain, all, gain / all * (1 - 16 * unit)};
}

NoSolution judge(const GlobalProblem& problem, const Vector& y, const Vector& given,
                 Exactness exactness) {
  const Vector z = given.size() > 0 ? given : Vector(Vector::Zero(problem.size(Dim::p)));
  std::vector<ExactSum> cone;
  std::vector<ExactSum> zero;
  double gain = 0;
  if (!sums(problem, y, z, cone, zero, gain)) return {};
  const bool near = exactness == Exactness::neighbour;
  if (!vanish(zero) && !(near && has_exact_neighbour(problem, y, z, gain))) return {};
  return {y, z, gain, 0, std::numeric_limits<double>::infinity()};
}

}  // namespace

template <class P>
NoSolution check_no_solution(const P& problem, const Vector& y, const Vector& z) {
  if constexpr (std::derived_from<P, GlobalProblem>) {
    // the law has no part in it
    return judge(static_cast<const GlobalProblem&>(problem), y, z, Exactness::neighbour);
  } else {
    return check_local(problem, friction_of(problem), y, z);
  }
}

template <class P>
NoSolution prove_no_solution(const P& problem, const Vector& y) {
  if constexpr (std::derived_from<P, GlobalProblem>) {
    const GlobalProblem& global = problem;
    NoSolution found = search(global, y);
    return found.proven() ? found : search(global, y, Exactness::neighbour);
  } else {
    return search(problem, y);
  }
}

#define FCLIB_INSTANTIATE(P)                                                        \
  template NoSolution check_no_solution<P>(const P&, const Vector&, const Vector&); \
  template NoSolution prove_no_solution<P>(const P&, const Vector&);
FCLIB_FOR_EACH_FORMULATION(FCLIB_INSTANTIATE)
#undef FCLIB_INSTANTIATE

}  // namespace fclib
