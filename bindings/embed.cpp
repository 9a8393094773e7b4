// What simulators embed: batches of small problems, and workspaces kept between solves.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>

#include <optional>
#include <string>

#include "arrays.hpp"
#include "embed/batch.hpp"
#include "embed/workspace.hpp"
#include "linalg/stopwatch.hpp"
#include "module.hpp"
#include "solve/driver.hpp"

namespace fclib::bindings {

using namespace nb::literals;

namespace {

template <class Number>
using In = nb::ndarray<const Number, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
template <class Number>
using Out = nb::ndarray<Number, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

}  // namespace

void bind_embed(nb::module_& m) {
  // fclib.solve_batch has checked the sizes
  m.def(
      "solve_batch",
      [](int spacedim, std::int64_t count, std::int32_t each,
         const std::optional<In<std::int32_t>>& nc, const In<double>& W, const In<double>& q,
         const In<double>& mu, const std::optional<In<double>>& guess, const Out<double>& r,
         const Out<double>& u, const Out<std::int32_t>& status, const Out<double>& error,
         const Out<std::int32_t>& iterations, double tolerance, int threads, double time_limit) {
        Batch batch;
        batch.spacedim = spacedim;
        batch.count = count;
        batch.nc_each = each;
        batch.nc = nc ? nc->data() : nullptr;
        batch.W = W.data();
        batch.q = q.data();
        batch.mu = mu.data();
        batch.guess = guess ? guess->data() : nullptr;
        batch.r = r.data();
        batch.u = u.data();
        batch.status = status.data();
        batch.error = error.data();
        batch.iterations = iterations.data();
        BatchSettings settings;
        settings.tolerance = tolerance;
        settings.threads = threads;
        settings.time_limit = time_limit;
        settings.poll = poll_signals;
        const Unlocked unlocked;
        return solve_batch(batch, settings).by_auto;
      },
      "spacedim"_a, "count"_a, "each"_a, "nc"_a.none(), "W"_a, "q"_a, "mu"_a, "guess"_a.none(),
      "r"_a, "u"_a, "status"_a, "error"_a, "iterations"_a, "tolerance"_a, "threads"_a,
      "time_limit"_a, "How many problems the solver auto has solved.");
  using Names = std::optional<In<std::int64_t>>;
  const auto span_of = [](const Names& names) {
    return names ? std::span<const std::int64_t>(names->data(), names->size())
                 : std::span<const std::int64_t>();
  };
  nb::class_<Workspace>(m, "Workspace", "The memory of fclib.Workspace.")
      .def(nb::init<>())
      .def(
          "solve",
          [span_of](Workspace& self, const LocalProblem& problem, const Names& contacts,
                    double tolerance, double time_limit) {
            Stopwatch watch;
            Result result;
            const Unlocked unlocked;
            const auto answer = self.solve(LocalView(problem), span_of(contacts),
                                           {.tolerance = tolerance, .time_limit = time_limit});
            const auto vector = [](std::span<const double> x) {
              return Eigen::Map<const Vector>(x.data(), static_cast<Eigen::Index>(x.size()));
            };
            result.solution.r = vector(answer.r);
            result.solution.u = vector(answer.u);
            result.status = answer.status;
            result.iterations = answer.iterations;
            result.error = answer.error;
            result.solver = answer.by_auto ? "auto" : "workspace";
            const Times spent = watch.read();
            result.cpu_s = spent.cpu;
            result.time = spent.wall;
            return result;
          },
          "problem"_a, "contacts"_a.none(), "tolerance"_a, "time_limit"_a)
      .def(
          "guess",
          [span_of](const Workspace& self, int spacedim, const Names& contacts,
                    const Out<double>& r) {
            self.guess(spacedim, span_of(contacts), {r.data(), r.size()});
          },
          "spacedim"_a, "contacts"_a.none(), "r"_a)
      .def(
          "keep",
          [span_of](Workspace& self, int spacedim, const Names& contacts, const In<double>& r) {
            self.keep(spacedim, span_of(contacts), {r.data(), r.size()});
          },
          "spacedim"_a, "contacts"_a.none(), "r"_a)
      .def("forget", &Workspace::forget);
  m.def(
      "status_names",
      [] {
        nb::list names;
        for (int k = 0; k <= static_cast<int>(Status::infeasible); ++k) {
          names.append(std::string(name_of(static_cast<Status>(k))));
        }
        return names;
      },
      nb::sig("def status_names() -> list[str]"), "Of each status of a batch, by its number.");
}

}  // namespace fclib::bindings
