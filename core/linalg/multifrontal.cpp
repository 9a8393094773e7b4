#include "linalg/multifrontal.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace fclib {

namespace {

/// Threads are used for a factorisation of at least so many multiplications.
constexpr double worth_threads = 3e7;

/// Threads share the rows below the pivots of a front; a panel has so many.
constexpr Index few = 768;

/// Operations, roughly, to assemble one entry of a front.
constexpr double moved = 10;

/// At most so many fronts for each thread are above the subtrees.
constexpr std::size_t cuts = 16;

/// A matrix or a part of one. The kernels do not write to what is only read.
template <class Matrix>
DenseView view(const Matrix& a) {
  return {const_cast<double*>(a.data()), a.rows(), a.cols(), a.outerStride()};
}

}  // namespace

Multifrontal::Multifrontal(const BlockPattern& pattern, int threads)
    : Multifrontal(analysed(pattern), threads) {}

Multifrontal::Multifrontal(std::shared_ptr<const Fronts> symbolic, int threads)
    : symbolic_(std::move(symbolic)), factors_(symbolic_->fronts.size()) {
  for (std::size_t f = 0; f < factors_.size(); ++f) {
    factors_[f].exchanged.resize(static_cast<std::size_t>(symbolic_->fronts[f].pivots));
  }
  share_out(symbolic_->flops > worth_threads ? threads : 1);
  work_.resize(std::max<std::size_t>(1, shares_.size()));
  permuted_.resize(symbolic_->size);
  local_.resize(work_.size(), Vector(symbolic_->largest));
}

/// Gives each thread subtrees of fronts; all threads share the fronts above. The cut is where the
/// time, counted in operations, is smallest.
void Multifrontal::share_out(int threads) {
  const std::size_t count = factors_.size();
  top_.clear();
  shares_.clear();
  if (threads <= 1) {
    top_.resize(count);
    std::iota(top_.begin(), top_.end(), std::size_t{0});
    return;
  }
  workers_ = std::make_unique<Workers>(threads);
  const auto own = static_cast<std::size_t>(workers_->count());
  std::vector<double> alone(count);  // operations of each front
  std::vector<double> below(count);  // ... of its subtree
  std::vector<std::size_t> parent(count, count);
  for (std::size_t f = 0; f < count; ++f) {
    const Front& front = symbolic_->fronts[f];
    const double k = front.pivots;
    const double u = front.size - front.pivots;
    alone[f] = k * k * k / 3 + k * k * u + k * u * u + moved * (k + u) * (k + u);
    below[f] += alone[f];
    for (const Index child : front.children) {
      below[f] += below[child];
      parent[child] = f;
    }
  }
  const auto smaller = [&](std::size_t a, std::size_t b) { return below[a] < below[b]; };
  std::vector<std::size_t> roots;  // a heap, the largest subtree first
  for (std::size_t f = 0; f < count; ++f) {
    if (parent[f] == count) roots.push_back(f);
  }
  std::make_heap(roots.begin(), roots.end(), smaller);
  std::vector<std::size_t> owner(count, own);  // the value `own`: of nobody
  const auto dealt = [&] {  // largest load; each subtree goes to the thread with the least
    std::vector<std::size_t> sorted = roots;
    std::sort_heap(sorted.begin(), sorted.end(), smaller);
    std::vector<double> load(own, 0.0);
    for (auto root = sorted.rbegin(); root != sorted.rend(); ++root) {
      const auto least = std::min_element(load.begin(), load.end());
      *least += below[*root];
      owner[*root] = static_cast<std::size_t>(least - load.begin());
    }
    return *std::max_element(load.begin(), load.end());
  };
  std::vector<std::size_t> opened;
  double above = 0;
  double best = dealt();
  std::size_t cut = 0;  // number of fronts opened in the best cut
  while (opened.size() < cuts * own && !roots.empty()) {
    std::pop_heap(roots.begin(), roots.end(), smaller);
    const std::size_t top = roots.back();
    roots.pop_back();
    opened.push_back(top);
    const Front& front = symbolic_->fronts[top];
    // the products of large fronts are shared out too
    above += front.size - front.pivots >= few ? alone[top] / static_cast<double>(own) : alone[top];
    for (const Index child : front.children) {
      roots.push_back(static_cast<std::size_t>(child));
      std::push_heap(roots.begin(), roots.end(), smaller);
    }
    if (const double time = above + dealt(); time < best) {
      best = time;
      cut = opened.size();
    }
  }
  // back to the best cut
  std::vector<char> open(count, 0);
  for (std::size_t k = 0; k < cut; ++k) open[opened[k]] = 1;
  roots.clear();
  for (std::size_t f = 0; f < count; ++f) {
    if (!open[f] && (parent[f] == count || open[parent[f]])) roots.push_back(f);
  }
  std::make_heap(roots.begin(), roots.end(), smaller);
  dealt();
  shares_.resize(own);
  for (std::size_t f = count; f-- > 0;) {
    if (!open[f] && parent[f] < count && !open[parent[f]]) owner[f] = owner[parent[f]];
  }
  for (std::size_t f = 0; f < count; ++f) {
    if (open[f]) {
      top_.push_back(f);
    } else {
      shares_[owner[f]].push_back(f);
    }
  }
}

/// Calls f(first, count) for the parts of 0..n on the threads. Parts begin at multiples of the
/// tiles of Eigen's kernels, 4 columns and up to 12 rows. So each number is summed in the same
/// order for any number of parts.
template <class F>
void Multifrontal::split(Index n, int threads, const F& f) {
  constexpr Index tile = 12;
  const Index parts = std::min<Index>(threads, n / (8 * tile));
  if (parts <= 1) return f(Index{0}, n);
  const Index part = n / parts / tile * tile;
  workers_->run_tasks(static_cast<int>(parts),
                      [&](int k) { f(k * part, k + 1 < parts ? part : n - k * part); });
}

bool Multifrontal::factorise_pivots(Eigen::Ref<Dense> a, std::vector<Index>& exchanged,
                                    const Task& task, int threads) {
  // right-looking by panels; the trailing update is a matrix product
  constexpr Index panel = 24;
  const auto n = static_cast<Index>(a.rows());
  for (Index start = 0; start < n; start += panel) {
    if (task.out_of_time()) return false;
    const Index width = std::min(panel, n - start);
    const Index end = start + width;
    if (!kernels_->eliminate(view(a), start, end, task.tiny, exchanged.data())) return false;
    if (end == n) break;
    const Index rest = n - end;
    split(rest, rest < few ? 1 : threads, [&](Index first, Index count) {
      const DenseView right = view(a.block(start, end + first, width, count));
      kernels_->solve_unit_lower(view(a.block(start, start, width, width)), right);
      kernels_->subtract_product(view(a.block(end, end + first, rest, count)),
                                 view(a.block(end, start, rest, width)), right);
    });
  }
  return true;
}

bool Multifrontal::factorise(const std::vector<double>& values, const Deadline* deadline) {
  const Eigen::Map<const Vector> all(values.data(), static_cast<Eigen::Index>(values.size()));
  if (!all.allFinite()) return false;
  const double largest = values.empty() ? 0 : all.lpNorm<Eigen::Infinity>();
  const Task task{values, 1e-18 * largest, deadline};
  std::vector<char> failed(shares_.size(), 0);
  const auto work_on = [&](std::size_t k) {
    for (const std::size_t f : shares_[k]) {
      if (!factorise_front(f, task, work_[k], 1)) failed[k] = 1;
      if (failed[k]) return;
    }
  };
  if (!shares_.empty()) {
    workers_->run_tasks(static_cast<int>(shares_.size()),
                        [&](int k) { work_on(static_cast<std::size_t>(k)); });
  }
  if (std::find(failed.begin(), failed.end(), 1) != failed.end()) return false;
  const int threads = std::max(1, static_cast<int>(shares_.size()));
  for (const std::size_t f : top_) {
    if (!factorise_front(f, task, work_[0], threads)) return false;
  }
  return true;
}

bool Multifrontal::factorise_front(std::size_t f, const Task& task, Dense& work, int threads) {
  const int d = symbolic_->d;
  const std::size_t block_size = static_cast<std::size_t>(d) * static_cast<std::size_t>(d);
  const Front& front = symbolic_->fronts[f];
  Factors& factors = factors_[f];
  if (work.rows() < front.size) work.resize(symbolic_->largest, symbolic_->largest);
  auto a = work.topLeftCorner(front.size, front.size);
  a.setZero();
  for (const Front::Entry& entry : front.entries) {
    const double* block = task.values.data() + block_size * static_cast<std::size_t>(entry.block);
    for (int c = 0; c < d; ++c) {
      for (int r = 0; r < d; ++r) a(entry.row + r, entry.col + c) += block[d * c + r];
    }
  }
  for (const Index child : front.children) {
    const Front& below = symbolic_->fronts[child];
    Factors& from = factors_[child];
    const double* source = from.update.data();
    for (const Index to : below.to_parent) {
      for (int c = 0; c < d; ++c) {
        double* target = &a(0, to + c);
        for (const Front::Run& run : below.runs) {
          Eigen::Map<Vector>(target + run.to, run.count) +=
              Eigen::Map<const Vector>(source, run.count);
          source += run.count;
        }
      }
    }
    from.update.resize(0, 0);
  }
  const Index k = front.pivots;
  const Index u = front.size - k;
  factors.diagonal = a.topLeftCorner(k, k);
  if (!factorise_pivots(factors.diagonal, factors.exchanged, task, threads)) return false;
  if (u == 0) return true;
  factors.upper = a.topRightCorner(k, u);
  for (Index row = 0; row < k; ++row) {
    const Index other = factors.exchanged[static_cast<std::size_t>(row)];
    if (other != row) factors.upper.row(row).swap(factors.upper.row(other));
  }
  split(u, threads, [&](Index first, Index count) {
    kernels_->solve_unit_lower(view(factors.diagonal),
                               view(factors.upper.middleCols(first, count)));
  });
  if (u >= few && task.out_of_time()) return false;
  factors.lower = a.bottomLeftCorner(u, k);
  split(u, threads, [&](Index first, Index count) {
    kernels_->solve_upper_from_right(view(factors.diagonal),
                                     view(factors.lower.middleRows(first, count)));
  });
  if (u >= few && task.out_of_time()) return false;
  factors.update = a.bottomRightCorner(u, u);
  split(u, threads, [&](Index first, Index count) {
    kernels_->subtract_product(view(factors.update.middleCols(first, count)), view(factors.lower),
                               view(factors.upper.middleCols(first, count)));
  });
  return true;
}

int Multifrontal::determinant_sign() const {
  bool negative = false;
  for (const Factors& factors : factors_) {
    for (Index k = 0; k < factors.diagonal.rows(); ++k) {
      if (factors.diagonal(k, k) < 0) negative = !negative;
      if (factors.exchanged[static_cast<std::size_t>(k)] != k) negative = !negative;
    }
  }
  return negative ? -1 : 1;
}

void Multifrontal::forward(std::size_t f, Vector& local) const {
  const int d = symbolic_->d;
  const Front& front = symbolic_->fronts[f];
  const Factors& factors = factors_[f];
  const Index u = front.size - front.pivots;
  const Index pivots = front.pivots / d;
  for (Index k = 0; k < pivots; ++k) {
    for (int c = 0; c < d; ++c) local[d * k + c] = permuted_[d * front.nodes[k] + c];
  }
  local.segment(front.pivots, u).setZero();
  for (const Index child : front.children) {
    const double* source = factors_[child].right.data();
    for (const Front::Run& run : symbolic_->fronts[child].runs) {
      local.segment(run.to, run.count) += Eigen::Map<const Vector>(source, run.count);
      source += run.count;
    }
  }
  auto top = local.head(front.pivots);
  for (Index k = 0; k < front.pivots; ++k) {
    const Index other = factors.exchanged[static_cast<std::size_t>(k)];
    if (other != k) std::swap(top[k], top[other]);
  }
  kernels_->solve_unit_lower(view(factors.diagonal), view(top));
  for (Index k = 0; k < pivots; ++k) {
    for (int c = 0; c < d; ++c) permuted_[d * front.nodes[k] + c] = local[d * k + c];
  }
  if (u == 0) return;
  factors.right = local.segment(front.pivots, u);
  kernels_->subtract_product(view(factors.right), view(factors.lower), view(top));
}

void Multifrontal::backward(std::size_t f, Vector& local) const {
  const int d = symbolic_->d;
  const Front& front = symbolic_->fronts[f];
  const Factors& factors = factors_[f];
  const Index u = front.size - front.pivots;
  for (std::size_t k = 0; k < front.nodes.size(); ++k) {
    for (int c = 0; c < d; ++c)
      local[d * static_cast<Index>(k) + c] = permuted_[d * front.nodes[k] + c];
  }
  auto top = local.head(front.pivots);
  if (u > 0) {
    kernels_->subtract_product(view(top), view(factors.upper),
                               view(local.segment(front.pivots, u)));
  }
  kernels_->solve_upper(view(factors.diagonal), view(top));
  for (Index k = 0; k < front.pivots / d; ++k) {
    for (int c = 0; c < d; ++c) permuted_[d * front.nodes[k] + c] = local[d * k + c];
  }
}

void Multifrontal::solve(Vector& b) const {
  const int d = symbolic_->d;
  const std::vector<Index>& position = symbolic_->position;
  const Index n = static_cast<Index>(position.size());
  for (Index node = 0; node < n; ++node) {
    for (int c = 0; c < d; ++c) permuted_[d * position[node] + c] = b[d * node + c];
  }
  const auto share = [&](const auto& work) {
    if (shares_.empty()) return;
    workers_->run_tasks(static_cast<int>(shares_.size()), [&](int k) {
      const auto own = static_cast<std::size_t>(k);
      work(shares_[own], local_[own]);
    });
  };
  share([&](const std::vector<std::size_t>& fronts, Vector& local) {
    for (const std::size_t f : fronts) forward(f, local);
  });
  for (const std::size_t f : top_) forward(f, local_[0]);
  for (auto f = top_.rbegin(); f != top_.rend(); ++f) backward(*f, local_[0]);
  share([&](const std::vector<std::size_t>& fronts, Vector& local) {
    for (auto f = fronts.rbegin(); f != fronts.rend(); ++f) backward(*f, local);
  });
  for (Index node = 0; node < n; ++node) {
    for (int c = 0; c < d; ++c) b[d * node + c] = permuted_[d * position[node] + c];
  }
}

}  // namespace fclib
