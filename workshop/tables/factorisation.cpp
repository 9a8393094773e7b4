// Times factorisations of a matrix whose pattern is read from stdin: by our orderings, or by
// libraries.
//
// In: d, the nodes, the blocks; first (nodes + 1); row (blocks). Out, with the word "orderings", a
// line for each ordering: CPU time of the plan [s], multiplications, numbers kept, least CPU time
// of a factorisation [s], error of a solve, the memory that a factorisation was said to take and
// that which it took [bytes]. With "libraries", a line for each: its name, least CPU time of the
// plan and of a factorisation [s], error of a solve.

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/SparseCore>
#include <Eigen/SparseLU>

#ifdef WITH_UMFPACK
#include <umfpack.h>
#endif
#ifdef WITH_CHOLMOD
#include <cholmod.h>
#endif

#include "linalg/fronts.hpp"
#include "linalg/multifrontal.hpp"

using namespace fclib;

namespace {

using Scalars = Eigen::SparseMatrix<double, Eigen::ColMajor, int>;

constexpr int repeats = 3;
constexpr double enough = 5;  // [s] a factorisation that takes longer is not repeated

double now() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// [bytes] The number behind a word of /proc/self/status, which has kilobytes.
double status(const std::string& word) {
  std::ifstream file("/proc/self/status");
  for (std::string key; file >> key;) {
    if (double value = 0; key == word && file >> value) return 1024 * value;
  }
  return 0;
}

/// Lets the peak of memory begin anew; what it is now [bytes].
double restart_peak() {
  malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << 5;
  return status("VmRSS:");
}

/// The same on every machine; the diagonal dominates. Symmetric blocks if so wanted: CHOLMOD takes
/// no others.
std::vector<double> values_of(const BlockPattern& pattern, bool symmetric) {
  std::vector<double> values(pattern.values());
  const auto d = static_cast<std::size_t>(pattern.d);
  const auto random = [](std::uint64_t state) {
    for (int k = 0; k < 3; ++k) state = state * 6364136223846793005U + 1442695040888963407U;
    return static_cast<double>(state >> 11U) * 0x1p-53 - 0.5;
  };
  for (Index col = 0; col < pattern.nodes(); ++col) {
    for (auto k = pattern.first[col]; k < pattern.first[col + 1]; ++k) {
      const auto row = static_cast<std::uint64_t>(pattern.row[static_cast<std::size_t>(k)]);
      for (std::size_t c = 0; c < d; ++c) {
        for (std::size_t r = 0; r < d; ++r) {
          std::uint64_t i = d * row + r;
          std::uint64_t j = d * static_cast<std::uint64_t>(col) + c;
          const bool diagonal = i == j;
          if (symmetric && i > j) std::swap(i, j);
          double value = random((i << 32U) + j);
          if (diagonal) {
            value = static_cast<double>(d) *
                    static_cast<double>(pattern.first[col + 1] - pattern.first[col]);
          }
          values[d * d * static_cast<std::size_t>(k) + d * c + r] = value;
        }
      }
    }
  }
  return values;
}

Scalars matrix_of(const BlockPattern& pattern, const std::vector<double>& values) {
  std::vector<Eigen::Triplet<double, int>> entries;
  entries.reserve(values.size());
  const int d = pattern.d;
  for (Index col = 0; col < pattern.nodes(); ++col) {
    for (auto k = pattern.first[col]; k < pattern.first[col + 1]; ++k) {
      const int row = d * pattern.row[static_cast<std::size_t>(k)];
      for (int c = 0; c < d; ++c) {
        for (int r = 0; r < d; ++r) {
          entries.emplace_back(row + r, d * col + c,
                               values[static_cast<std::size_t>(d * d * k + d * c + r)]);
        }
      }
    }
  }
  Scalars result(d * pattern.nodes(), d * pattern.nodes());
  result.setFromTriplets(entries.begin(), entries.end());
  return result;
}

/// Prints a line; `plan`, `factorise` and `solve` are calls of a library.
template <class Plan, class Factorise, class Solve>
void measure(const char* name, const Scalars& a, Plan plan, Factorise factorise, Solve solve) {
  double begin = now();
  plan();
  const double planned = now() - begin;
  double least = 1e300;
  for (int run = 0; run < repeats && (run == 0 || least < enough); ++run) {
    begin = now();
    factorise();
    least = std::min(least, now() - begin);
  }
  const Vector b = Vector::Ones(a.rows());
  const Vector x = solve(b);
  std::printf("%s %.6g %.6g %.3g\n", name, planned, least,
              (a * x - b).norm() / std::sqrt(static_cast<double>(a.rows())));
}

void time_orderings(const BlockPattern& pattern, const std::vector<double>& values) {
  const Scalars a = matrix_of(pattern, values);
  const Vector b = Vector::Ones(a.rows());
  for (const Ordering ordering : {Ordering::minimum_degree, Ordering::nested_dissection}) {
    if (ordering == Ordering::nested_dissection && !has_nested_dissection()) continue;
    const double start = now();
    const auto fronts = std::make_shared<const Fronts>(pattern, ordering);
    const double plan = now() - start;
    Multifrontal lu(fronts);
    double least = 1e300;
    double taken = 0;
    const double before = restart_peak();
    for (int run = 0; run < repeats; ++run) {
      const double begin = now();
      lu.factorise(values);
      least = std::min(least, now() - begin);
      if (run == 0) taken = status("VmHWM:") - before;
    }
    Vector x = b;
    lu.solve(x);
    std::printf("%.6g %.6g %.6g %.6g %.3g %.6g %.6g\n", plan, fronts->flops, fronts->memory, least,
                (a * x - b).norm() / std::sqrt(static_cast<double>(a.rows())), lu.bytes(), taken);
  }
}

void time_libraries(const BlockPattern& pattern, const std::vector<double>& values) {
  const Scalars a = matrix_of(pattern, values);
  {
    std::unique_ptr<Multifrontal> lu;
    measure(
        "ours", a,
        [&] { lu = std::make_unique<Multifrontal>(std::make_shared<const Fronts>(pattern)); },
        [&] { lu->factorise(values); },
        [&](Vector b) {
          lu->solve(b);
          return b;
        });
  }
  {
    Eigen::SparseLU<Scalars> lu;
    measure(
        "SparseLU", a, [&] { lu.analyzePattern(a); }, [&] { lu.factorize(a); },
        [&](const Vector& b) -> Vector { return lu.solve(b); });
  }
#ifdef WITH_UMFPACK
  {
    void* symbolic = nullptr;
    void* numeric = nullptr;
    const int n = static_cast<int>(a.rows());
    measure(
        "UMFPACK", a,
        [&] {
          umfpack_di_symbolic(n, n, a.outerIndexPtr(), a.innerIndexPtr(), a.valuePtr(), &symbolic,
                              nullptr, nullptr);
        },
        [&] {
          umfpack_di_free_numeric(&numeric);
          umfpack_di_numeric(a.outerIndexPtr(), a.innerIndexPtr(), a.valuePtr(), symbolic, &numeric,
                             nullptr, nullptr);
        },
        [&](const Vector& b) {
          Vector x(b.size());
          umfpack_di_solve(UMFPACK_A, a.outerIndexPtr(), a.innerIndexPtr(), a.valuePtr(), x.data(),
                           b.data(), numeric, nullptr, nullptr);
          return x;
        });
    umfpack_di_free_numeric(&numeric);
    umfpack_di_free_symbolic(&symbolic);
  }
#endif
#ifdef WITH_CHOLMOD
  {
    const Scalars whole = matrix_of(pattern, values_of(pattern, true));
    Scalars lower = whole.triangularView<Eigen::Lower>();
    lower.makeCompressed();
    cholmod_common common;
    cholmod_start(&common);
    cholmod_sparse sparse{};
    sparse.nrow = sparse.ncol = static_cast<std::size_t>(lower.rows());
    sparse.nzmax = static_cast<std::size_t>(lower.nonZeros());
    sparse.p = lower.outerIndexPtr();
    sparse.i = lower.innerIndexPtr();
    sparse.x = lower.valuePtr();
    sparse.stype = -1;
    sparse.itype = CHOLMOD_INT;
    sparse.xtype = CHOLMOD_REAL;
    sparse.dtype = CHOLMOD_DOUBLE;
    sparse.sorted = sparse.packed = 1;
    cholmod_factor* factor = nullptr;
    measure(
        "CHOLMOD", whole, [&] { factor = cholmod_analyze(&sparse, &common); },
        [&] { cholmod_factorize(&sparse, factor, &common); },
        [&](Vector b) {
          cholmod_dense right{};
          right.nrow = right.nzmax = right.d = static_cast<std::size_t>(b.size());
          right.ncol = 1;
          right.x = b.data();
          right.xtype = CHOLMOD_REAL;
          right.dtype = CHOLMOD_DOUBLE;
          cholmod_dense* x = cholmod_solve(CHOLMOD_A, factor, &right, &common);
          Vector result = Eigen::Map<Vector>(static_cast<double*>(x->x), b.size());
          cholmod_free_dense(&x, &common);
          return result;
        });
    cholmod_free_factor(&factor, &common);
    cholmod_finish(&common);
  }
#endif
}

}  // namespace

int main(int, char** words) {
  BlockPattern pattern;
  std::size_t nodes = 0;
  std::size_t blocks = 0;
  std::cin >> pattern.d >> nodes >> blocks;
  pattern.first.resize(nodes + 1);
  for (auto& one : pattern.first) std::cin >> one;
  pattern.row.resize(blocks);
  for (auto& one : pattern.row) std::cin >> one;
  if (!std::cin) return 1;
  const std::vector<double> values = values_of(pattern, false);
  const bool libraries = words[1] == std::string("libraries");
  (libraries ? time_libraries : time_orderings)(pattern, values);
}
