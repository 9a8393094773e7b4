// What simulators embed: batches of small problems, and workspaces kept between solves.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>

#include <optional>
#include <string>
#include <tuple>

#include "arrays.hpp"
#include "embed/batch.hpp"
#include "embed/derivatives.hpp"
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
template <class Number>
using Maybe = std::optional<In<Number>>;
template <class Number>
using MaybeOut = std::optional<Out<Number>>;

template <class Number>
const Number* data_of(const Maybe<Number>& array) {
  return array ? array->data() : nullptr;
}

}  // namespace

void bind_embed(nb::module_& m) {
  // fclib.solve_batch and its like have checked the sizes
  m.def(
      "solve_batch",
      [](int spacedim, std::int64_t count, std::int32_t each, const Maybe<std::int32_t>& nc,
         const Maybe<double>& W, const Maybe<double>& q, const Maybe<std::int32_t>& starts,
         const Maybe<std::int32_t>& columns, bool one_pattern, std::int32_t n_each,
         const Maybe<std::int32_t>& n, const Maybe<double>& M, const Maybe<double>& H,
         const Maybe<double>& f, const Maybe<double>& w, const In<double>& mu,
         const Maybe<double>& mu_r, const Maybe<double>& mu_s, bool coupled,
         const Maybe<double>& guess, const Out<double>& r, const Out<double>& u,
         const MaybeOut<double>& v, const Out<std::int32_t>& status, const Out<double>& error,
         const Out<std::int32_t>& iterations, double tolerance, int threads, double time_limit) {
        Batch batch;
        batch.spacedim = spacedim;
        batch.count = count;
        batch.nc_each = each;
        batch.nc = data_of(nc);
        batch.W = data_of(W);
        batch.q = data_of(q);
        batch.starts = data_of(starts);
        batch.columns = data_of(columns);
        batch.one_pattern = one_pattern;
        batch.n_each = n_each;
        batch.n = data_of(n);
        batch.M = data_of(M);
        batch.H = data_of(H);
        batch.f = data_of(f);
        batch.w = data_of(w);
        batch.mu = mu.data();
        batch.mu_r = data_of(mu_r);
        batch.mu_s = data_of(mu_s);
        batch.coupled = coupled;
        batch.guess = data_of(guess);
        batch.r = r.data();
        batch.u = u.data();
        batch.v = v ? v->data() : nullptr;
        batch.status = status.data();
        batch.error = error.data();
        batch.iterations = iterations.data();
        BatchSettings settings;
        settings.tolerance = tolerance;
        settings.threads = threads;
        settings.time_limit = time_limit;
        settings.poll = poll_signals;
        BatchOutcome outcome;
        {
          const Unlocked unlocked;
          outcome = solve_batch(batch, settings);
        }
        return std::tuple(outcome.by_auto, outcome.first_invalid, outcome.wrong);
      },
      "spacedim"_a, "count"_a, "each"_a, "nc"_a.none(), "W"_a.none(), "q"_a.none(),
      "starts"_a.none(), "columns"_a.none(), "one_pattern"_a, "n_each"_a, "n"_a.none(),
      "M"_a.none(), "H"_a.none(), "f"_a.none(), "w"_a.none(), "mu"_a, "mu_r"_a.none(),
      "mu_s"_a.none(), "coupled"_a, "guess"_a.none(), "r"_a, "u"_a, "v"_a.none(), "status"_a,
      "error"_a, "iterations"_a, "tolerance"_a, "threads"_a, "time_limit"_a,
      "How many problems the solver auto has solved, the first one whose data are not valid (or "
      "-1), and what is wrong with it.");
  const auto solved =
      [](int spacedim, std::int64_t count, std::int32_t each, const Maybe<std::int32_t>& nc,
         const In<double>& W, const In<double>& q, const In<double>& mu, const In<double>& r,
         const MaybeOut<std::uint8_t>& degenerate, const MaybeOut<std::uint8_t>& unique) {
        SolvedBatch batch;
        batch.spacedim = spacedim;
        batch.count = count;
        batch.nc_each = each;
        batch.nc = data_of(nc);
        batch.W = W.data();
        batch.q = q.data();
        batch.mu = mu.data();
        batch.r = r.data();
        batch.degenerate = degenerate ? degenerate->data() : nullptr;
        batch.unique = unique ? unique->data() : nullptr;
        return batch;
      };
  m.def(
      "vjp_batch",
      [solved](int spacedim, std::int64_t count, std::int32_t each, const Maybe<std::int32_t>& nc,
               const In<double>& W, const In<double>& q, const In<double>& mu, const In<double>& r,
               std::int64_t sides, const Maybe<double>& by_r, const Maybe<double>& by_u,
               const MaybeOut<double>& by_W, const MaybeOut<double>& by_q,
               const MaybeOut<double>& by_mu, const MaybeOut<std::uint8_t>& degenerate,
               const MaybeOut<std::uint8_t>& unique, int threads) {
        const Unlocked unlocked;
        adjoint(solved(spacedim, count, each, nc, W, q, mu, r, degenerate, unique),
                {sides, data_of(by_r), data_of(by_u), by_W ? by_W->data() : nullptr,
                 by_q ? by_q->data() : nullptr, by_mu ? by_mu->data() : nullptr},
                {.threads = threads, .poll = poll_signals});
      },
      "spacedim"_a, "count"_a, "each"_a, "nc"_a.none(), "W"_a, "q"_a, "mu"_a, "r"_a, "sides"_a,
      "by_r"_a.none(), "by_u"_a.none(), "by_W"_a.none(), "by_q"_a.none(), "by_mu"_a.none(),
      "degenerate"_a.none(), "unique"_a.none(), "threads"_a);
  m.def(
      "jvp_batch",
      [solved](int spacedim, std::int64_t count, std::int32_t each, const Maybe<std::int32_t>& nc,
               const In<double>& W, const In<double>& q, const In<double>& mu, const In<double>& r,
               std::int64_t sides, const Maybe<double>& dW, const Maybe<double>& dq,
               const Maybe<double>& dmu, const MaybeOut<double>& dr, const MaybeOut<double>& du,
               const MaybeOut<std::uint8_t>& degenerate, const MaybeOut<std::uint8_t>& unique,
               int threads) {
        const Unlocked unlocked;
        forward(solved(spacedim, count, each, nc, W, q, mu, r, degenerate, unique),
                {sides, data_of(dW), data_of(dq), data_of(dmu), dr ? dr->data() : nullptr,
                 du ? du->data() : nullptr},
                {.threads = threads, .poll = poll_signals});
      },
      "spacedim"_a, "count"_a, "each"_a, "nc"_a.none(), "W"_a, "q"_a, "mu"_a, "r"_a, "sides"_a,
      "dW"_a.none(), "dq"_a.none(), "dmu"_a.none(), "dr"_a.none(), "du"_a.none(),
      "degenerate"_a.none(), "unique"_a.none(), "threads"_a);
  m.def(
      "sensitivities_batch",
      [solved](int spacedim, std::int64_t count, std::int32_t each, const In<double>& W,
               const In<double>& q, const In<double>& mu, const In<double>& r,
               const Out<double>& by_q, const Out<double>& by_mu, int threads) {
        const Unlocked unlocked;
        sensitivities(solved(spacedim, count, each, {}, W, q, mu, r, {}, {}),
                      {by_q.data(), by_mu.data()}, {.threads = threads, .poll = poll_signals});
      },
      "spacedim"_a, "count"_a, "each"_a, "W"_a, "q"_a, "mu"_a, "r"_a, "by_q"_a, "by_mu"_a,
      "threads"_a);
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
            const auto answer = self.solve(
                LocalView(problem), span_of(contacts),
                {.tolerance = tolerance, .time_limit = time_limit, .poll = poll_signals});
            if (answer.by_auto != nullptr) result = *answer.by_auto;
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
          [span_of](Workspace& self, int spacedim, const Names& contacts, const Out<double>& r) {
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
        for (int k = 0; k < static_cast<int>(status_count); ++k) {
          names.append(std::string(name_of(static_cast<Status>(k))));
        }
        return names;
      },
      nb::sig("def status_names() -> list[str]"), "Of each status of a batch, by its number.");
}

}  // namespace fclib::bindings
