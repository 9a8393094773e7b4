#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <memory>
#include <utility>

#include "arrays.hpp"
#include "linalg/cpu_time.hpp"
#include "module.hpp"
#include "problem.hpp"
#include "reduced/by_rows.hpp"
#include "solve/solver.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace fclib::bindings {

namespace {

nb::object local_problem(const ReducedProblem& reduced) {
  const auto fill = [&]<class P>(P problem) {
    problem.spacedim = reduced.d();
    problem.W = by_rows(reduced.W);
    problem.q = reduced.q;
    problem.mu = reduced.friction.mu;
    if constexpr (P::rolling) problem.mu_r = reduced.friction.mu_r;
    return nb::cast(std::move(problem));
  };
  return reduced.friction.mu_r.size() > 0 ? fill(LocalRollingProblem{}) : fill(LocalProblem{});
}

/// What a Python solver talks to while it works: fclib::Monitor, and the error of its iterates.
class Watch {
 public:
  Watch(const ReducedProblem& problem, const Settings& settings)
      : settings_(settings), monitor_(settings_), problem_(&problem) {}
  Watch(const Watch&) = delete;

  [[nodiscard]] const Settings& settings() const { return settings_; }
  [[nodiscard]] double time_left() const { return settings_.time_limit - monitor_.elapsed(); }
  [[nodiscard]] double scale() const { return problem().scale; }
  /// The solve is over: its data is no longer there.
  void close() { problem_ = nullptr; }

  [[nodiscard]] Vector checked(nb::handle object) const {
    Vector r = vector_from(object, "r");
    if (r.size() != problem().m()) {
      throw Error(ErrorKind::problem,
                  "has " + std::to_string(r.size()) +
                      " entries, expected m = " + std::to_string(problem().m()),
                  "r");
    }
    return r;
  }

  double error(nb::handle object) const { return error_of(problem(), checked(object)); }

  bool stop(nb::handle r, const std::optional<std::int64_t>& iteration) {
    set_iterations(iteration.value_or(started_ ? iterations_ + 1 : 0));
    started_ = true;
    const double reached = error(r);
    try {
      reason_ = monitor_.report(iterations_, reached);
    } catch (nb::python_error& raised) {
      failure = nb::borrow(raised.value());
      throw;
    }
    return reason_.has_value();
  }

  void set_status(const std::string& name) {
    for (int k = 0; k <= static_cast<int>(Status::interrupted); ++k) {
      claim_ = static_cast<Status>(k);
      if (name_of(*claim_) == name) return;
    }
    throw Error(ErrorKind::option, "there is no status '" + name + "'", "status");
  }
  /// Why the solver ended: its own reason, the reason to stop that it was told, or converged.
  [[nodiscard]] Status status() const {
    return claim_ ? *claim_ : reason_.value_or(Status::converged);
  }

  [[nodiscard]] std::int64_t iterations() const { return iterations_; }
  void set_iterations(std::int64_t count) {
    if (count < 0) {
      throw Error(ErrorKind::option, std::to_string(count) + " is negative", "iterations");
    }
    iterations_ = count;
  }
  [[nodiscard]] std::optional<double> cpu_s() const { return cpu_s_; }
  void set_cpu_s(std::optional<double> seconds) {
    if (seconds && !std::isfinite(*seconds)) {
      throw Error(ErrorKind::option, std::to_string(*seconds) + " is not finite", "cpu_s");
    }
    cpu_s_ = seconds;
  }
  nb::object failure = nb::none();  ///< what the callback raised

 private:
  [[nodiscard]] const ReducedProblem& problem() const {
    if (problem_ == nullptr) throw std::runtime_error("the solve of this monitor is over");
    return *problem_;
  }

  Settings settings_;
  Monitor monitor_;
  const ReducedProblem* problem_;
  bool started_ = false;
  std::int64_t iterations_ = 0;
  std::optional<double> cpu_s_;
  std::optional<Status> reason_;
  std::optional<Status> claim_;
};

/// Runs function(problem, r, monitor, options) -> r.
Outcome run(const nb::object& function, const std::vector<OptionInfo>& infos,
            const ReducedProblem& reduced, const OptionValues& values, const Settings& settings,
            Vector& r) {
  const nb::gil_scoped_acquire gil;
  const OptionValues options = parse_options(infos, values);
  const nb::object problem = local_problem(reduced);
  const nb::object guess = to_python(r, nb::handle()).attr("copy")();
  auto* watch = new Watch(reduced, settings);
  const nb::object monitor = nb::cast(watch, nb::rv_policy::take_ownership);
  struct Closer {
    Watch* watch;
    ~Closer() { watch->close(); }
  } closer{watch};
  const double start = cpu_time();
  const nb::object answer = function(problem, guess, monitor, options);
  const double cpu_s = cpu_time() - start;
  r = watch->checked(answer);
  return {.status = watch->status(),
          .iterations = watch->iterations(),
          .cpu_s = watch->cpu_s().value_or(cpu_s)};
}

Solver python_solver(const std::string& name, const std::string& family, const std::string& title,
                     const std::string& citation, const std::string& origin,
                     const std::vector<int>& dimensions, const std::vector<int>& rolling_dimensions,
                     const std::vector<OptionInfo>& options, std::int64_t max_iterations,
                     const nb::object& function) {
  return {.name = name,
          .family = family,
          .title = title,
          .citation = citation,
          .dimensions = dimensions,
          .rolling_dimensions = rolling_dimensions,
          .options = options,
          .max_iterations = max_iterations,
          .solve = [function, options](
                       const ReducedProblem& problem, const OptionValues& values,
                       const Settings& settings,
                       Vector& r) { return run(function, options, problem, values, settings, r); },
          .origin = origin};
}

}  // namespace

void bind_python_solvers(nb::module_& m) {
  nb::class_<Watch>(m, "Monitor", "Watches over a solver written in Python.")
      .def("stop", &Watch::stop, "r"_a, "iteration"_a = nb::none(),
           nb::sig("def stop(self, r: numpy.typing.ArrayLike, iteration: int | None = None) -> "
                   "bool"),
           "Reports an iterate, and says whether to stop: at the tolerance, at a limit, or because "
           "the caller asks for it. Iterations count from 0, the starting point, one a call, if "
           "no number is given.")
      .def("error", &Watch::error, "r"_a,
           nb::sig("def error(self, r: numpy.typing.ArrayLike) -> float"),
           "The error that the tolerance bounds: ||r - P_K(r - u^)|| / scale; inf if r is not "
           "finite.")
      .def_prop_ro("tolerance", [](const Watch& w) { return w.settings().tolerance; })
      .def_prop_ro("max_iterations", [](const Watch& w) { return w.settings().max_iterations; })
      .def_prop_ro("time_left", &Watch::time_left, "[s] wall clock, inf if there is no limit")
      .def_prop_ro("scale", &Watch::scale, "what errors are relative to: ||q|| of the problem")
      .def_prop_rw("iterations", &Watch::iterations, &Watch::set_iterations,
                   "that the result will state; 0 or more")
      .def_prop_rw("cpu_s", &Watch::cpu_s, &Watch::set_cpu_s, nb::for_setter(nb::arg().none()),
                   "[s] to be set if the time is not that of the calling thread; finite")
      .def_prop_rw(
          "status", [](const Watch& w) { return std::string(name_of(w.status())); },
          [](Watch& w, const std::string& name) { w.set_status(name); },
          "why the solver ends; what it claims is judged afterwards")
      .def_ro("failure", &Watch::failure, "what the caller's callback raised");
  m.def("python_solver", &python_solver, nb::kw_only(), "name"_a, "family"_a, "title"_a,
        "citation"_a, "origin"_a, "dimensions"_a, "rolling_dimensions"_a, "options"_a,
        "max_iterations"_a, "function"_a, "A solver that calls a function of Python.");
}

}  // namespace fclib::bindings
