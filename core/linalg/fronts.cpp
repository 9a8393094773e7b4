#include "linalg/fronts.hpp"

#include <Eigen/OrderingMethods>
#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#ifdef FCLIB_METIS
#include <metis.h>

#include <mutex>
#endif

namespace fclib {

namespace {

/// A front is merged with its parent if the zeros that this stores cost less than the bookkeeping:
/// always below this many scalars, and as long as few of the entries are zeros.
constexpr double small_front = 24;
constexpr double zero_share = 0.15;

/// A system of at most so many scalars is one dense front.
constexpr Index dense_size = 96;

std::vector<Index> minimum_degree(const BlockPattern& pattern) {
  const Index n = pattern.nodes();
  using Pattern = Eigen::SparseMatrix<double, Eigen::ColMajor, Index>;
  std::vector<Index> outer(pattern.first.begin(), pattern.first.end());
  const std::vector<double> ones(pattern.row.size(), 1.0);
  const Eigen::Map<const Pattern> graph(n, n, static_cast<Index>(pattern.row.size()), outer.data(),
                                        pattern.row.data(), ones.data());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, Index> order;
  Eigen::AMDOrdering<Index> amd;
  amd(Pattern(graph), order);
  // order(k) is the node that is eliminated as k-th
  return {order.indices().data(), order.indices().data() + n};
}

/// A factorisation with at least so many multiplications tries another ordering, which costs once
/// some tenths of them. workshop/tables/factorisation.py tried packings and walls of 90 to 9,704
/// contacts: for smaller factorisations nothing is gained.
constexpr double worth_dissection = 1e8;

/// By METIS. Nothing if the build has none, or if METIS fails.
std::optional<std::vector<Index>> nested_dissection([[maybe_unused]] const BlockPattern& pattern) {
#ifdef FCLIB_METIS
  constexpr auto most = static_cast<std::size_t>(std::numeric_limits<idx_t>::max());
  if (pattern.row.size() >= most) return std::nullopt;
  auto count = static_cast<idx_t>(pattern.nodes());
  std::vector<idx_t> first(1, 0);
  std::vector<idx_t> row;
  row.reserve(pattern.row.size());
  for (Index col = 0; col < pattern.nodes(); ++col) {  // without the diagonal
    for (auto k = pattern.first[col]; k < pattern.first[col + 1]; ++k) {
      const Index other = pattern.row[static_cast<std::size_t>(k)];
      if (other != col) row.push_back(static_cast<idx_t>(other));
    }
    first.push_back(static_cast<idx_t>(row.size()));
  }
  std::vector<idx_t> order(static_cast<std::size_t>(count));
  std::vector<idx_t> position(order.size());
  std::array<idx_t, METIS_NOPTIONS> options{};
  METIS_SetDefaultOptions(options.data());
  options[METIS_OPTION_SEED] = 0;   // one result, wherever it is called
  static std::mutex one_at_a_time;  // METIS has one random generator for the process
  const std::lock_guard lock(one_at_a_time);
  if (METIS_NodeND(&count, first.data(), row.data(), nullptr, options.data(), order.data(),
                   position.data()) != METIS_OK) {
    return std::nullopt;
  }
  return std::vector<Index>(order.begin(), order.end());
#else
  return std::nullopt;
#endif
}

/// The parents in the elimination tree of the pattern with this numbering (Liu 1986).
std::vector<Index> elimination_tree(const BlockPattern& pattern, const std::vector<Index>& order,
                                    const std::vector<Index>& position) {
  const auto n = order.size();
  std::vector<Index> parent(n, -1);
  std::vector<Index> ancestor(n, -1);
  for (std::size_t col = 0; col < n; ++col) {
    const auto node = static_cast<std::size_t>(order[col]);
    for (auto k = pattern.first[node]; k < pattern.first[node + 1]; ++k) {
      Index row = position[pattern.row[static_cast<std::size_t>(k)]];
      while (row >= 0 && row < static_cast<Index>(col)) {
        const Index next = ancestor[row];
        ancestor[row] = static_cast<Index>(col);
        if (next < 0) parent[row] = static_cast<Index>(col);
        row = next;
      }
    }
  }
  return parent;
}

std::vector<Index> postorder(const std::vector<Index>& parent) {
  const auto n = parent.size();
  std::vector<Index> head(n, -1);
  std::vector<Index> next(n, -1);
  std::vector<Index> roots;
  for (std::size_t k = n; k-- > 0;) {
    if (parent[k] < 0) {
      roots.push_back(static_cast<Index>(k));
    } else {
      next[k] = head[parent[k]];
      head[parent[k]] = static_cast<Index>(k);
    }
  }
  std::vector<Index> result;
  result.reserve(n);
  std::vector<Index> stack;
  for (auto root = roots.rbegin(); root != roots.rend(); ++root) {
    stack.push_back(*root);
    while (!stack.empty()) {
      const Index top = stack.back();
      if (head[top] >= 0) {
        const Index child = head[top];
        head[top] = next[child];
        stack.push_back(child);
      } else {
        result.push_back(top);
        stack.pop_back();
      }
    }
  }
  return result;
}

}  // namespace

bool has_nested_dissection() {
#ifdef FCLIB_METIS
  return true;
#else
  return false;
#endif
}

Fronts::Fronts(const BlockPattern& pattern, Ordering ordering) : d(pattern.d) {
  if (ordering == Ordering::best) {
    *this = Fronts(pattern, Ordering::minimum_degree);
    if (flops < worth_dissection || !has_nested_dissection()) return;
    Fronts other(pattern, Ordering::nested_dissection);
    if (other.flops < flops) *this = std::move(other);
    return;
  }
  const Index n = pattern.nodes();
  size = d * n;
  position.resize(static_cast<std::size_t>(n));
  std::vector<Index> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), 0);

  // pivot nodes and update nodes of each front, in the final numbering
  std::vector<std::vector<Index>> structure;
  std::vector<Index> pivots;
  std::vector<Index> front_parent;
  if (size <= dense_size) {
    std::iota(position.begin(), position.end(), 0);
    if (n > 0) {
      structure.push_back(order);
      pivots.push_back(n);
      front_parent.push_back(-1);
    }
  } else {
    std::optional<std::vector<Index>> dissected;
    if (ordering == Ordering::nested_dissection) dissected = nested_dissection(pattern);
    if (dissected) this->ordering = ordering;
    order = dissected ? *std::move(dissected) : minimum_degree(pattern);
    const auto number = [&] {
      for (std::size_t k = 0; k < order.size(); ++k) position[order[k]] = static_cast<Index>(k);
    };
    number();
    std::vector<Index> parent = elimination_tree(pattern, order, position);
    const std::vector<Index> post = postorder(parent);
    std::vector<Index> reordered(order.size());
    for (std::size_t k = 0; k < order.size(); ++k) reordered[k] = order[post[k]];
    order = reordered;
    number();
    parent = elimination_tree(pattern, order, position);

    // the structure of each column of L, and fronts built from the leaves up
    const auto count = static_cast<std::size_t>(n);
    std::vector<std::vector<Index>> children(count);
    for (std::size_t k = 0; k < count; ++k) {
      if (parent[k] >= 0) children[parent[k]].push_back(static_cast<Index>(k));
    }
    std::vector<Index> front_of(count, -1);  // of the column, if it is the last pivot
    std::vector<Index> mark(count, -1);
    std::vector<double> zeros;
    for (std::size_t k = 0; k < count; ++k) {
      const auto col = static_cast<Index>(k);
      // the front of the child whose pivots end just before
      const Index last = k > 0 && parent[k - 1] == col ? front_of[k - 1] : -1;
      std::vector<Index> rows;
      mark[k] = col;
      if (last >= 0) {  // its rows but the first, which is this column: mostly they are all
        rows.assign(structure[last].begin() + pivots[last] + 1, structure[last].end());
        for (const Index row : rows) mark[row] = col;
      }
      const std::size_t sorted = rows.size();
      const auto add = [&](Index row) {
        if (row > col && mark[row] != col) {
          mark[row] = col;
          rows.push_back(row);
        }
      };
      const auto node = static_cast<std::size_t>(order[k]);
      for (auto e = pattern.first[node]; e < pattern.first[node + 1]; ++e) {
        add(position[pattern.row[static_cast<std::size_t>(e)]]);
      }
      for (const Index child : children[k]) {
        const Index front = front_of[child];
        if (front == last) continue;
        std::for_each(structure[front].begin() + pivots[front], structure[front].end(), add);
      }
      const auto middle = rows.begin() + static_cast<std::ptrdiff_t>(sorted);
      std::sort(middle, rows.end());
      std::inplace_merge(rows.begin(), middle, rows.end());
      bool merge = false;
      double empty = 0;
      if (last >= 0) {
        const double width = pivots[last];
        const double child_rows = static_cast<double>(structure[last].size());
        const double new_rows = width + 1 + static_cast<double>(rows.size());
        empty = zeros[last] + 2 * width * (new_rows - child_rows);
        const double all = new_rows * new_rows - std::pow(static_cast<double>(rows.size()), 2);
        merge = empty == 0 || new_rows * d <= small_front || empty <= zero_share * all;
      }
      if (merge) {
        structure[last].resize(static_cast<std::size_t>(pivots[last]));
        structure[last].push_back(col);
        structure[last].insert(structure[last].end(), rows.begin(), rows.end());
        ++pivots[last];
        zeros[last] = empty;
        front_of[k] = last;
      } else {
        front_of[k] = static_cast<Index>(structure.size());
        rows.insert(rows.begin(), col);
        structure.push_back(std::move(rows));
        pivots.push_back(1);
        zeros.push_back(0);
      }
    }
    front_parent.assign(structure.size(), -1);
    for (std::size_t f = 0; f < structure.size(); ++f) {
      const Index last_pivot = structure[f][static_cast<std::size_t>(pivots[f]) - 1];
      if (parent[last_pivot] >= 0) front_parent[f] = front_of[parent[last_pivot]];
    }
  }

  // fronts are numbered by their first pivot, which is a postorder
  fronts.resize(structure.size());
  std::vector<Index> where(static_cast<std::size_t>(n), -1);  // offset of a node in the front
  std::vector<Index> node_front(static_cast<std::size_t>(n));
  for (std::size_t f = 0; f < structure.size(); ++f) {
    Front& front = fronts[f];
    front.nodes = std::move(structure[f]);
    front.pivots = d * pivots[f];
    front.size = d * static_cast<Index>(front.nodes.size());
    largest = std::max(largest, front.size);
    for (Index k = 0; k < pivots[f]; ++k) node_front[front.nodes[k]] = static_cast<Index>(f);
    const double k = front.pivots;
    const double u = front.size - front.pivots;
    flops += k * k * k / 3 + k * k * u + k * u * u;
    memory += k * k + 2 * k * u;
  }
  for (std::size_t f = 0; f < fronts.size(); ++f) {
    if (front_parent[f] < 0) continue;
    Front& up = fronts[front_parent[f]];
    up.children.push_back(static_cast<Index>(f));
    for (std::size_t k = 0; k < up.nodes.size(); ++k)
      where[up.nodes[k]] = d * static_cast<Index>(k);
    Front& front = fronts[f];
    for (auto k = static_cast<std::size_t>(pivots[f]); k < front.nodes.size(); ++k) {
      const Index to = where[front.nodes[k]];
      front.to_parent.push_back(to);
      if (front.runs.empty() || front.runs.back().to + front.runs.back().count != to) {
        front.runs.push_back({to, 0});
      }
      front.runs.back().count += d;
    }
  }
  // a front has the entries whose lower index is one of its pivots
  for (Index col = 0; col < n; ++col) {
    const auto node = static_cast<std::size_t>(order[col]);
    for (auto e = pattern.first[node]; e < pattern.first[node + 1]; ++e) {
      const Index row = position[pattern.row[static_cast<std::size_t>(e)]];
      fronts[node_front[std::min(row, col)]].entries.push_back({e, row, col});
    }
  }
  for (Front& front : fronts) {
    for (std::size_t k = 0; k < front.nodes.size(); ++k)
      where[front.nodes[k]] = d * static_cast<Index>(k);
    for (Front::Entry& entry : front.entries) {
      entry.row = where[entry.row];
      entry.col = where[entry.col];
    }
  }
}

std::shared_ptr<const Fronts> analysed(const BlockPattern& pattern) {
  constexpr std::size_t kept = 4;  // a solve may have systems on contacts, bodies and islands
  if (pattern.d * pattern.nodes() <= dense_size) return std::make_shared<Fronts>(pattern);
  thread_local std::deque<std::pair<BlockPattern, std::shared_ptr<const Fronts>>> known;
  const auto at = std::find_if(known.begin(), known.end(),
                               [&](const auto& entry) { return entry.first == pattern; });
  if (at != known.end()) {
    std::rotate(known.begin(), at, at + 1);
  } else {
    known.emplace_front(pattern, std::make_shared<Fronts>(pattern));
    if (known.size() > kept) known.pop_back();
  }
  return known.front().second;
}

}  // namespace fclib
