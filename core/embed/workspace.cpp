#include "embed/workspace.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "deadline.hpp"
#include "embed/contact_judge.hpp"
#include "embed/memory.hpp"
#include "solve/driver.hpp"

namespace fclib {

namespace {

/// For larger problems, `auto` with its sparse factors is the better choice.
constexpr std::size_t most_contacts = 400;
constexpr double poll_interval = 0.1;  // [s]

/// Does something at the end of a block, however it is left.
template <class Action>
class Finally {
 public:
  explicit Finally(Action action) : action_(std::move(action)) {}
  ~Finally() { action_(); }
  Finally(const Finally&) = delete;
  Finally& operator=(const Finally&) = delete;

 private:
  Action action_;
};

[[noreturn]] void refuse(const char* where, const std::string& what) {
  throw Error(ErrorKind::problem, what, where);
}

void require_sizes(const LocalView& problem, std::size_t names) {
  if (problem.spacedim != 2 && problem.spacedim != 3) {
    refuse("spacedim", "is " + std::to_string(problem.spacedim) + ", expected 2 or 3");
  }
  const std::size_t m = static_cast<std::size_t>(problem.spacedim) * problem.mu.size();
  if (problem.q.size() != m) {
    refuse("q", "has " + std::to_string(problem.q.size()) +
                    " entries, expected m = " + std::to_string(m));
  }
  if (static_cast<std::size_t>(problem.W.rows) != m || problem.W.rows != problem.W.cols) {
    refuse("W", "is " + std::to_string(problem.W.rows) + " x " + std::to_string(problem.W.cols) +
                    ", expected m = " + std::to_string(m));
  }
  if (names > 0 && names != problem.mu.size()) {
    refuse("contacts", "has " + std::to_string(names) +
                           " names, expected nc = " + std::to_string(problem.mu.size()));
  }
  for (std::size_t k = 0; k < m; ++k) {
    if (!std::isfinite(problem.q[k])) refuse("q", "has an entry that is not finite");
  }
  for (std::size_t a = 0; a < problem.mu.size(); ++a) {
    if (problem.mu[a] >= 0 && std::isfinite(problem.mu[a])) continue;
    refuse("mu", "contact " + std::to_string(a) + " has " + std::to_string(problem.mu[a]) +
                     ", expected a finite number that is not negative");
  }
}

LocalProblem copied(const LocalView& view) {
  LocalProblem problem;
  problem.spacedim = view.spacedim;
  problem.q = Eigen::Map<const Vector>(view.q.data(), static_cast<Eigen::Index>(view.q.size()));
  problem.mu = Eigen::Map<const Vector>(view.mu.data(), static_cast<Eigen::Index>(view.mu.size()));
  problem.W.storage = Storage::triplet;
  problem.W.rows = view.W.rows;
  problem.W.cols = view.W.cols;
  view.W.visit([&](Index row, Index col, double value) {
    problem.W.i.push_back(row);
    problem.W.p.push_back(col);
    problem.W.x.push_back(value);
  });
  return problem;
}

}  // namespace

void Workspace::guess(int spacedim, std::span<const std::int64_t> contacts,
                      std::span<double> r) const {
  std::fill(r.begin(), r.end(), 0.0);
  const auto d = static_cast<std::size_t>(spacedim);
  if (known_ == 0 || spacedim != spacedim_) return;
  if (contacts.empty()) {
    if (r.size() == d * known_) std::copy_n(last_.begin(), r.size(), r.begin());
    return;
  }
  if (!named_) return;
  const auto end = names_.begin() + static_cast<std::ptrdiff_t>(known_);
  for (std::size_t a = 0; a < contacts.size(); ++a) {
    const auto at =
        std::lower_bound(names_.begin(), end, contacts[a],
                         [](const auto& known, std::int64_t name) { return known.first < name; });
    if (at == end || at->first != contacts[a]) continue;
    std::copy_n(last_.begin() + static_cast<std::ptrdiff_t>(d * at->second), d,
                r.begin() + static_cast<std::ptrdiff_t>(d * a));
  }
}

void Workspace::keep(int spacedim, std::span<const std::int64_t> contacts,
                     std::span<const double> r) {
  spacedim_ = spacedim;
  known_ = r.size() / static_cast<std::size_t>(spacedim);
  named_ = !contacts.empty();
  grow(last_, r.size());
  std::copy(r.begin(), r.end(), last_.begin());
  if (!named_) return;
  grow(names_, known_);
  for (std::size_t a = 0; a < known_; ++a) names_[a] = {contacts[a], a};
  std::sort(names_.begin(), names_.begin() + static_cast<std::ptrdiff_t>(known_));
}

/// u = W r + q, and the merit of r, both in extended precision.
template <int D>
double Workspace::judge(const LocalView& problem) {
  using std::abs;  // or that of Real
  const std::size_t nc = problem.mu.size();
  std::fill_n(real_.begin(), D * nc, Real(0));
  std::fill_n(size_.begin(), D * nc, Real(0));
  problem.W.visit([&](Index row, Index col, double value) {
    real_[static_cast<std::size_t>(row)] += full_product(value, r_[static_cast<std::size_t>(col)]);
    if (row == col) size_[static_cast<std::size_t>(row)] += Real(value);
  });
  for (std::size_t k = 0; k < D * nc; ++k) {
    real_[k] += Real(problem.q[k]);
    u_[k] = static_cast<double>(real_[k]);
  }
  const auto of = [](const auto& x) {
    return [&x](std::int64_t a) {
      ContactVector<D, Real> part;
      for (int k = 0; k < D; ++k) part[k] = x[static_cast<std::size_t>(D * a + k)];
      return part;
    };
  };
  // entries of a triplet add up before their size counts
  const auto size = [&](std::int64_t a) {
    Real sum = 0;
    for (int k = 0; k < D; ++k) sum += abs(size_[static_cast<std::size_t>(D * a + k)]) / D;
    return sum;
  };
  return contact_error<D>(static_cast<std::int64_t>(nc), problem.mu.data(), r_.data(), size,
                          of(real_), of(problem.q));
}

template <int D>
Workspace::Answer Workspace::solve_in(SmallSolver<D>& solver, const LocalView& problem,
                                      const Settings& settings) {
  const std::size_t nc = problem.mu.size();
  Answer answer;
  if (const char* wrong = solver.take(problem.W, problem.q.data(), problem.mu.data())) {
    refuse("W", wrong);
  }
  const Deadline deadline(settings.time_limit);
  double last_poll = now({});
  std::optional<Status> ended;  // before a solution was found
  const auto stops = [&] {
    if (ended) return true;
    if (deadline.passed()) {
      ended = Status::time_limit;
    } else if (settings.poll && now({}) - last_poll > poll_interval) {
      last_poll = now({});
      if (!settings.poll()) ended = Status::interrupted;
    }
    return ended.has_value();
  };
  if (static_cast<std::size_t>(solver.largest()) <= most_contacts) {
    // a reference takes no memory of its own
    if (settings.poll || std::isfinite(settings.time_limit)) solver.stop_if(std::ref(stops));
    const Finally forget([&] { solver.stop_if({}); });
    // the answer has the merit itself, not a bound on it
    answer.error =
        solver.solve(settings.tolerance, r_.data(), [&] { return judge<D>(problem); }, false);
    answer.iterations = solver.iterations();
    if (answer.error <= settings.tolerance) {
      answer.status = Status::converged;
      return answer;
    }
    if (stops()) {
      if (!std::isfinite(answer.error)) {
        std::fill_n(r_.begin(), D * nc, 0.0);
        answer.error = judge<D>(problem);
      }
      answer.status = *ended;
      return answer;
    }
  }
  static const Solver& whole_way = find_solver("auto");
  fclib::Settings asked;
  asked.tolerance = settings.tolerance;
  asked.time_limit = deadline.left();
  asked.poll = settings.poll;
  Solution start;
  start.r = Eigen::Map<const Vector>(r_.data(), static_cast<Eigen::Index>(D * nc));
  if (!start.r.allFinite()) start.r.resize(0);
  whole_ = fclib::solve(copied(problem), whole_way, asked, {}, start);
  answer.by_auto = &whole_;
  answer.status = whole_.status;
  answer.error = whole_.error;
  answer.iterations += whole_.iterations;
  std::copy(whole_.solution.r.begin(), whole_.solution.r.end(), r_.begin());
  std::copy(whole_.solution.u.begin(), whole_.solution.u.end(), u_.begin());
  return answer;
}

Workspace::Answer Workspace::solve(const LocalView& problem, std::span<const std::int64_t> contacts,
                                   const Settings& settings) {
  check_tolerance(settings.tolerance);
  require_sizes(problem, contacts.size());
  const std::size_t m = problem.q.size();
  grow(r_, m);
  grow(u_, m);
  grow(real_, m);
  grow(size_, m);
  guess(problem.spacedim, contacts, {r_.data(), m});
  Answer answer = problem.spacedim == 2 ? solve_in(plane_, problem, settings)
                                        : solve_in(space_, problem, settings);
  answer.r = {r_.data(), m};
  answer.u = {u_.data(), m};
  keep(problem.spacedim, contacts, answer.r);
  return answer;
}

}  // namespace fclib
