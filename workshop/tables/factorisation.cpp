// Times the factorisation of a matrix whose pattern is read from stdin, by each ordering.
//
// In: d, the nodes, the blocks; first (nodes + 1); row (blocks). Out, a line for each ordering:
// CPU time of the plan [s], multiplications, numbers kept, least CPU time of a factorisation [s],
// error of a solve, the memory that a factorisation was said to take and that which it took
// [bytes].

#include <malloc.h>

#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <iostream>
#include <string>

#include "linalg/fronts.hpp"
#include "linalg/multifrontal.hpp"

using namespace fclib;

namespace {

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

/// The same on every machine; the diagonal dominates.
std::vector<double> values_of(const BlockPattern& pattern) {
  std::vector<double> values(pattern.values());
  std::uint64_t state = 1;
  for (double& value : values) {
    state = state * 6364136223846793005U + 1442695040888963407U;
    value = static_cast<double>(state >> 11U) * 0x1p-53 - 0.5;
  }
  const auto d = static_cast<std::size_t>(pattern.d);
  for (Index col = 0; col < pattern.nodes(); ++col) {
    const auto begin = pattern.first[col];
    const auto end = pattern.first[col + 1];
    for (auto k = begin; k < end; ++k) {
      if (pattern.row[static_cast<std::size_t>(k)] != col) continue;
      for (std::size_t c = 0; c < d; ++c) {
        values[d * d * static_cast<std::size_t>(k) + (d + 1) * c] =
            static_cast<double>(d) * static_cast<double>(end - begin);
      }
    }
  }
  return values;
}

}  // namespace

int main() {
  BlockPattern pattern;
  std::size_t nodes = 0;
  std::size_t blocks = 0;
  std::cin >> pattern.d >> nodes >> blocks;
  pattern.first.resize(nodes + 1);
  for (auto& one : pattern.first) std::cin >> one;
  pattern.row.resize(blocks);
  for (auto& one : pattern.row) std::cin >> one;
  if (!std::cin) return 1;
  const std::vector<double> values = values_of(pattern);
  for (const Ordering ordering : {Ordering::minimum_degree, Ordering::nested_dissection}) {
    if (ordering == Ordering::nested_dissection && !has_nested_dissection()) continue;
    const double start = now();
    const auto fronts = std::make_shared<const Fronts>(pattern, ordering);
    const double plan = now() - start;
    Multifrontal lu(fronts);
    double least = 1e300;
    double taken = 0;
    const double before = restart_peak();
    for (int run = 0; run < 3; ++run) {
      const double begin = now();
      if (!lu.factorise(values)) return 1;
      least = std::min(least, now() - begin);
      if (run == 0) taken = status("VmHWM:") - before;
    }
    Vector x = Vector::Ones(lu.size());
    lu.solve(x);
    // A x - 1, by the values
    Vector rest = -Vector::Ones(lu.size());
    const int d = pattern.d;
    for (Index col = 0; col < pattern.nodes(); ++col) {
      for (auto k = pattern.first[col]; k < pattern.first[col + 1]; ++k) {
        rest.segment(d * pattern.row[static_cast<std::size_t>(k)], d) +=
            Eigen::Map<const Eigen::MatrixXd>(values.data() + std::ptrdiff_t{d} * d * k, d, d) *
            x.segment(d * col, d);
      }
    }
    std::printf("%.6g %.6g %.6g %.6g %.3g %.6g %.6g\n", plan, fronts->flops, fronts->memory, least,
                rest.norm() / std::sqrt(static_cast<double>(lu.size())), lu.bytes(), taken);
  }
}
