// The functions of the core that fclib.js calls. Nothing is thrown: each returns { value } or
// { error }, of which fclib.js makes an exception of JavaScript.

#include <emscripten/bind.h>

#include <new>
#include <string>

#include "convert.hpp"
#include "convert/condense.hpp"
#include "convert/eliminate.hpp"
#include "convert/islands.hpp"
#include "io/siconos/siconos.hpp"
#include "merit/merit.hpp"
#include "merit/merit_1.hpp"
#include "proof/no_solution.hpp"
#include "solve/driver.hpp"
#include "version.hpp"

namespace fclib::browser {

namespace {

constexpr const char* kinds[] = {"file", "problem", "option", "unsuitable"};

val failure(const char* kind, const std::string& message, const std::string& where = {}) {
  val error = val::object();
  error.set("kind", std::string(kind));
  error.set("message", message);
  error.set("where", where);
  val result = val::object();
  result.set("error", error);
  return result;
}

template <class F>
val guarded(const F& run) {
  try {
    val result = val::object();
    result.set("value", run());
    return result;
  } catch (const Error& error) {
    return failure(kinds[static_cast<int>(error.kind)], error.what(), error.where);
  } catch (const std::bad_alloc&) {
    return failure("memory", "the problem does not fit into the memory of this page");
  } catch (const std::exception& error) {
    return failure("internal", error.what());
  }
}

/// Calls visit(problem) with the problem of an object.
template <class Visitor>
val with_problem(const val& object, const Visitor& visit) {
  return guarded([&] {
    const Problem problem = problem_from(object);
    return std::visit([&](const auto& p) { return visit(p); }, problem);
  });
}

template <class T, class F>
val list_of(const T& values, const F& convert) {
  val result = val::array();
  for (const auto& value : values) result.call<void>("push", convert(value));
  return result;
}

const char* name_of(ContactStatus status) {
  return status == ContactStatus::open    ? "open"
         : status == ContactStatus::stick ? "stick"
                                          : "slide";
}

// ---- what there is

val value_of(const OptionValue& value) {
  return std::visit([](const auto& v) { return val(v); },
                    std::holds_alternative<std::int64_t>(value)
                        ? OptionValue(static_cast<double>(std::get<std::int64_t>(value)))
                        : value);
}

val describe(const OptionInfo& option) {
  val result = val::object();
  result.set("name", option.name);
  result.set("type", option.type);
  result.set("default", value_of(option.default_value));
  result.set("unit", option.unit);
  result.set("doc", option.doc);
  result.set("choices", list_of(option.choices, [](const std::string& one) { return val(one); }));
  result.set("lowest", option.lowest);
  result.set("highest", option.highest);
  return result;
}

val describe_solvers() {
  return list_of(solvers(), [](const Solver* solver) {
    const auto numbers = [](int one) { return val(one); };
    val result = val::object();
    result.set("name", solver->name);
    result.set("family", solver->family);
    result.set("title", solver->title);
    result.set("citation", solver->citation);
    result.set("dimensions", list_of(solver->dimensions, numbers));
    result.set("rolling_dimensions", list_of(solver->rolling_dimensions, numbers));
    result.set("max_iterations", to_js(solver->max_iterations));
    result.set("options", list_of(solver->options, [](const auto& one) { return describe(one); }));
    return result;
  });
}

template <class Member>
const char* type_name() {
  if constexpr (std::is_same_v<Member, Matrix>) {
    return "matrix";
  } else if constexpr (std::is_same_v<Member, Vector>) {
    return "vector";
  } else if constexpr (std::is_same_v<Member, std::string>) {
    return "text";
  } else {
    return "number";
  }
}

template <class Struct>
val describe_fields() {
  val result = val::array();
  for_each_field<Struct>([&]<class Member>(const Field<Struct, Member>& field) {
    val one = val::object();
    one.set("name", to_js(field.name));
    one.set("type", std::string(type_name<Member>()));
    one.set("rows", to_js(fclib::name_of(field.rows)));
    one.set("cols", to_js(fclib::name_of(field.cols)));
    one.set("required", field.presence == Presence::required);
    one.set("unit", to_js(field.unit));
    one.set("doc", to_js(field.doc));
    result.call<void>("push", one);
  });
  return result;
}

/// The fields of all structs, by the names of these.
val describe_structs() {
  val problems = val::object();
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    val one = val::object();
    one.set("doc", std::string(P::doc));
    one.set("dimensions", to_js(P::dimensions.data(), P::dimensions.size()));
    one.set("fields", describe_fields<P>());
    problems.set(std::string(P::kind), one);
  });
  val result = val::object();
  result.set("version", std::string(version));
  result.set("problems", problems);
  result.set("solution", describe_fields<Solution>());
  result.set("merit", describe_fields<Merit>());
  result.set("info", describe_fields<ProblemInfo>());
  result.set("matrix_info", describe_fields<MatrixInfo>());
  return result;
}

// ---- problems

val validate_problem(const val& object) {
  return with_problem(object, [](const auto& p) {
    validate(p);
    val sizes = val::object();
    sizes.set("formulation", formulation(p));
    sizes.set("n", p.size(Dim::n));
    sizes.set("m", p.size(Dim::m));
    sizes.set("p", p.size(Dim::p));
    sizes.set("nc", p.size(Dim::nc));
    return sizes;
  });
}

val validate_solution(const val& object, const val& solution, const std::string& where) {
  return with_problem(object, [&](const auto& p) {
    validate(solution_from(solution), p, where);
    return val::undefined();
  });
}

val read_siconos_text(const std::string& text, const std::string& kind) {
  return guarded([&] {
    return std::visit([](const auto& p) { return problem_to_js(p); }, parse_siconos(text, kind));
  });
}

val condense_problem(const val& object) {
  return with_problem(object, []<class P>(const P& p) -> val {
    validate(p);
    if constexpr (requires { condense(p); }) {
      return problem_to_js(condense(p));
    } else {
      throw Error(ErrorKind::unsuitable, "a " + std::string(P::kind) + " problem is condensed");
    }
  });
}

val eliminate_problem(const val& object) {
  return with_problem(object, []<class P>(const P& p) -> val {
    validate(p);
    if constexpr (requires { eliminate(p); }) {
      return problem_to_js(eliminate(p));
    } else {
      throw Error(ErrorKind::unsuitable,
                  "a " + std::string(P::kind) + " problem must be condensed first");
    }
  });
}

val store_problem(const val& object, const std::string& storage) {
  return with_problem(object, [&](const auto& p) {
    validate(p);
    return problem_to_js(with_storage(p, storage_of(storage)));
  });
}

val islands_of(const val& object) {
  return with_problem(object, [](const auto& p) {
    validate(p);
    const Islands found = islands(p);
    val result = val::object();
    result.set("count", found.count);
    result.set("contact", to_js(found.contact));
    result.set("dof", to_js(found.dof));
    result.set("bilateral", to_js(found.bilateral));
    return result;
  });
}

// ---- merits

val merit_of(const val& object, const val& solution) {
  return with_problem(object,
                      [&](const auto& p) { return members_of(merit(p, solution_from(solution))); });
}

val merit_1_of(const val& object, const val& solution) {
  return with_problem(object,
                      [&](const auto& p) { return val(merit_1(p, solution_from(solution))); });
}

val contact_merits_of(const val& object, const val& solution) {
  return with_problem(object, [&](const auto& p) {
    const ContactMerits merits = contact_merits(p, solution_from(solution));
    val result = val::object();
    result.set("status", list_of(merits.status,
                                 [](ContactStatus one) { return val(std::string(name_of(one))); }));
    result.set("u", to_js(merits.u));
    result.set("natural", to_js(merits.natural));
    result.set("cone", to_js(merits.cone));
    result.set("dual_cone", to_js(merits.dual_cone));
    result.set("mismatches", list_of(merits.mismatches, [](const Mismatch& one) {
                 val row = val::object();
                 row.set("part", to_js(one.part));
                 row.set("index", one.index);
                 row.set("stored", one.stored);
                 row.set("difference", one.difference);
                 row.set("error", one.error);
                 return row;
               }));
    return result;
  });
}

val proof_to_js(const NoSolution& proof) {
  if (!proof.proven()) return val::null();
  val result = val::object();
  result.set("y", to_js(proof.y));
  if (proof.z.size() > 0) result.set("z", to_js(proof.z));
  result.set("gain", proof.gain);
  result.set("distance", proof.distance);
  result.set("bound", proof.bound);
  return result;
}

val check_certificate(const val& object, const val& y, const val& z) {
  return with_problem(object, [&](const auto& p) {
    validate(p);
    const Vector own = vector_from(y, "y");
    const Vector other = is_missing(z) ? Vector() : vector_from(z, "z");
    const auto require = [](const Vector& values, Index size, const char* name, const char* dim) {
      if (values.size() == size) return;
      throw Error(ErrorKind::problem,
                  "has " + std::to_string(values.size()) + " entries, expected " + dim + " = " +
                      std::to_string(size),
                  name);
    };
    require(own, p.size(Dim::nc), "y", "nc");
    require(other, p.size(Dim::p), "z", "p");
    return proof_to_js(check_no_solution(p, own, other));
  });
}

val prove(const val& object, const val& y) {
  return with_problem(object, [&](const auto& p) {
    validate(p);
    const Vector own = vector_from(y, "y");
    if (own.size() != p.size(Dim::nc)) {
      throw Error(ErrorKind::problem,
                  "has " + std::to_string(own.size()) +
                      " entries, expected nc = " + std::to_string(p.size(Dim::nc)),
                  "y");
    }
    return proof_to_js(prove_no_solution(p, own));
  });
}

// ---- solving

OptionValues options_from(const val& object) {
  OptionValues result;
  if (is_missing(object)) return result;
  const val keys = val::global("Object").call<val>("keys", object);
  for (int k = 0; k < keys["length"].as<int>(); ++k) {
    const auto key = keys[k].as<std::string>();
    const val value = object[key];
    const std::string type = type_of(value);
    if (type == "boolean") {
      result[key] = value.as<bool>();
    } else if (type == "number") {
      // an integer of JavaScript is a number like others
      const auto number = value.as<double>();
      const bool whole = number == std::trunc(number) && std::abs(number) < 9e15;
      result[key] = whole ? OptionValue(static_cast<std::int64_t>(number)) : OptionValue(number);
    } else if (type == "string") {
      result[key] = value.as<std::string>();
    } else {
      throw Error(ErrorKind::option, "is not a truth value, a number or a text", "option " + key);
    }
  }
  return result;
}

val history_to_js(const std::vector<HistoryPoint>& points) {
  return list_of(points, [](const HistoryPoint& point) {
    val one = val::object();
    one.set("iteration", to_js(point.iteration));
    one.set("error", point.error);
    one.set("time", point.time);
    one.set("stage", point.stage);
    return one;
  });
}

val result_to_js(const Result& result) {
  val object = val::object();
  object.set("solver", result.solver);
  object.set("status", to_js(fclib::name_of(result.status)));
  object.set("converged", result.converged());
  object.set("iterations", to_js(result.iterations));
  object.set("error", result.error);
  object.set("cpu_s", result.cpu_s);
  object.set("setup_s", result.setup_s);
  object.set("solution", members_of(result.solution));
  object.set("certificate", proof_to_js(result.certificate));
  object.set("stages", list_of(result.stages, [](const Stage& stage) {
               val one = val::object();
               one.set("name", stage.kind.name);
               one.set("families", stage.kind.families);
               one.set("calls", to_js(stage.calls));
               one.set("solved", to_js(stage.solved));
               one.set("iterations", to_js(stage.iterations));
               one.set("factorisations", to_js(stage.factorisations));
               one.set("time", stage.time);
               return one;
             }));
  if (result.history) object.set("history", history_to_js(*result.history));
  return object;
}

/// Another clock, for tests of what looks at it.
Clock clock_from(const val& clock) {
  if (is_missing(clock)) return {};
  return [clock] { return clock().as<double>(); };
}

/// `settings` has all of them, as fclib.js has filled them in; `report` is a function or undefined.
val solve_problem(const val& object, const val& settings, const val& report) {
  return with_problem(object, [&](const auto& p) {
    Settings own{
        .tolerance = settings["tol"].as<double>(),
        .merit =
            settings["merit"].as<std::string>() == "natural" ? MeritKind::natural : MeritKind::both,
        .max_iterations = static_cast<std::int64_t>(settings["max_iterations"].as<double>()),
        .time_limit = settings["time_limit"].as<double>(),
        .clock = clock_from(settings["clock"]),
        .history = settings["history"].as<bool>()};
    if (!report.isUndefined()) {
      own.callback = [&](const Progress& progress) {
        const Vector* r = progress.r;
        return report(to_js(progress.iteration), progress.error, progress.time,
                      std::string(progress.stage),
                      r != nullptr ? reinterpret_cast<int>(r->data()) : 0,
                      r != nullptr ? static_cast<int>(r->size()) : 0)
            .template as<bool>();
      };
    }
    const val guess = settings["guess"];
    return result_to_js(solve(p, settings["solver"].as<std::string>(), own,
                              options_from(settings["options"]),
                              is_missing(guess) ? Solution{} : solution_from(guess)));
  });
}

/// A copy of numbers where the core has them.
val numbers_at(int address, int size) {
  return to_js(reinterpret_cast<const double*>(address), static_cast<std::size_t>(size));
}

}  // namespace

EMSCRIPTEN_BINDINGS(fclib) {
  using emscripten::function;
  function("solvers", describe_solvers);
  function("structs", describe_structs);
  function("validate", validate_problem);
  function("validate_solution", validate_solution);
  function("read_siconos", read_siconos_text);
  function("condense", condense_problem);
  function("eliminate", eliminate_problem);
  function("with_storage", store_problem);
  function("islands", islands_of);
  function("merit", merit_of);
  function("merit_1", merit_1_of);
  function("contact_merits", contact_merits_of);
  function("check_certificate", check_certificate);
  function("prove_no_solution", prove);
  function("solve", solve_problem);
  function("numbers_at", numbers_at);
}

}  // namespace fclib::browser
