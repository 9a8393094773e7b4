// The functions of the core that fclib.js calls. Nothing is thrown: each returns { value } or
// { error }, of which fclib.js makes an exception of JavaScript.

#include <emscripten/bind.h>

#include <algorithm>
#include <new>
#include <string>
#include <utility>

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

/// The error of a call; undefined if there was none.
template <class F>
val failure_of(const F& run) {
  try {
    run();
    return val::undefined();
  } catch (const Error& error) {
    return failure(kinds[static_cast<int>(error.kind)], error.what(), error.where);
  } catch (const std::bad_alloc&) {
    return failure("memory", "the problem does not fit into the memory of this page");
  } catch (const std::exception& error) {
    return failure("internal", error.what());
  }
}

template <class F>
val guarded(const F& run) {
  val result = val::object();
  val failed = failure_of([&] { result.set("value", run()); });
  return failed.isUndefined() ? result : failed;
}

/// Calls visit(problem, block) with the problem of a block. The block may have more parts.
template <class Visitor>
val with_problem(int address, const Visitor& visit) {
  return guarded([&] {
    Block block(address);
    const Problem problem = problem_from(block);
    return std::visit([&](const auto& p) { return visit(p, block); }, problem);
  });
}

/// Calls convert(problem) with the problem of a block and of its object, valid; its result goes
/// back.
template <class Conversion>
val converted(int address, const val& object, const Conversion& convert) {
  return guarded([&] {
    Block block(address);
    Problem problem = problem_from(block);
    return std::visit(
        [&](auto& p) {
          carry(p, object);
          validate(p);
          return problem_to_js(convert(p));
        },
        problem);
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

// ---- lists: solvers, fields, options

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
    result.set("spin_dimensions", list_of(solver->spin_dimensions, numbers));
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

/// The fields of each struct, by the name of the struct.
val describe_structs() {
  val problems = val::object();
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    val one = val::object();
    one.set("doc", std::string(P::doc));
    one.set("dimensions", to_js(P::dimensions.data(), P::dimensions.size()));
    one.set("fields", describe_fields<P>());
    problems.set(std::string(P::kind), one);
  });
  val statuses = val::array();
  for (int k = 0; k < static_cast<int>(status_count); ++k) {
    statuses.call<void>("push", to_js(fclib::name_of(static_cast<Status>(k))));
  }
  val storages = val::array();
  for (const auto storage : {Storage::triplet, Storage::csc, Storage::csr, Storage::dense}) {
    storages.set(static_cast<int>(storage), to_js(fclib::name_of(storage)));
  }
  val result = val::object();
  result.set("version", std::string(version));
  result.set("problems", problems);
  result.set("solution", describe_fields<Solution>());
  result.set("statuses", statuses);
  result.set("storages", storages);
  result.set("merit", describe_fields<Merit>());
  result.set("info", describe_fields<ProblemInfo>());
  result.set("matrix_info", describe_fields<MatrixInfo>());
  return result;
}

val number_of_storage(const std::string& name) {
  return guarded([&] { return val(static_cast<int>(storage_of(name))); });
}

// ---- problems

val validate_problem(int address) {
  return with_problem(address, [](const auto& p, Block&) {
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

val validate_solution(int address, const std::string& where) {
  return with_problem(address, [&](const auto& p, Block& block) {
    validate(solution_from(block), p, where);
    return val::undefined();
  });
}

val read_siconos_text(const std::string& text, const std::string& kind) {
  return guarded([&] {
    return std::visit([](const auto& p) { return problem_to_js(p); }, parse_siconos(text, kind));
  });
}

val condense_problem(int address, const val& object) {
  return converted(address, object, []<class P>(const P& p) {
    if constexpr (requires { p.H; }) {
      return condense(p);
    } else {
      throw Error(ErrorKind::unsuitable, "a " + std::string(P::kind) + " problem is condensed");
      return p;
    }
  });
}

val eliminate_problem(int address, const val& object) {
  return converted(address, object, []<class P>(const P& p) {
    if constexpr (requires { eliminate(p); }) {
      return eliminate(p);
    } else {
      throw Error(ErrorKind::unsuitable,
                  "a " + std::string(P::kind) + " problem must be condensed first");
      return p;
    }
  });
}

val store_problem(int address, const val& object, const std::string& storage) {
  return converted(address, object,
                   [&](const auto& p) { return with_storage(p, storage_of(storage)); });
}

val islands_of(int address) {
  return with_problem(address, [](const auto& p, Block&) {
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

val merit_of(int address) {
  return with_problem(address, [&](const auto& p, Block& block) {
    return members_of(merit(p, solution_from(block)));
  });
}

val merit_1_of(int address) {
  return with_problem(
      address, [&](const auto& p, Block& block) { return val(merit_1(p, solution_from(block))); });
}

val contact_merits_of(int address) {
  return with_problem(address, [&](const auto& p, Block& block) {
    const ContactMerits merits = contact_merits(p, solution_from(block));
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

void require_size(const Vector& values, Index size, const char* name, const char* dim) {
  if (values.size() == size) return;
  throw Error(ErrorKind::problem,
              "has " + std::to_string(values.size()) + " entries, expected " + dim + " = " +
                  std::to_string(size),
              name);
}

val check_certificate(int address) {
  return with_problem(address, [](const auto& p, Block& block) {
    validate(p);
    const Vector y = vector_from(block);
    const Vector z = vector_from(block);
    require_size(y, p.size(Dim::nc), "y", "nc");
    if (z.size() > 0) require_size(z, p.size(Dim::p), "z", "p");
    return proof_to_js(check_no_solution(p, y, z));
  });
}

val prove(int address) {
  return with_problem(address, [](const auto& p, Block& block) {
    validate(p);
    const Vector y = vector_from(block);
    require_size(y, p.size(Dim::nc), "y", "nc");
    return proof_to_js(prove_no_solution(p, y));
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

/// The last result, until fclib.js has taken it: each call takes microseconds, as many solves do.
struct Answer {
  Result result;
  std::vector<double> numbers;
  val failure = val::undefined();
};
Answer& answer() {
  static Answer last;
  return last;
}

/// The stages that any result had; its numbers refer to them.
std::vector<StageKind>& known_stages() {
  static std::vector<StageKind> known;
  return known;
}

double number_of(const StageKind& kind) {
  std::vector<StageKind>& known = known_stages();
  const auto found = std::find_if(known.begin(), known.end(), [&](const StageKind& one) {
    return one.name == kind.name && one.families == kind.families;
  });
  const auto number = std::distance(known.begin(), found);
  if (found == known.end()) known.push_back(kind);
  return static_cast<double>(number);
}

val known_stage(int number) {
  const StageKind& kind = known_stages()[static_cast<std::size_t>(number)];
  val one = val::object();
  one.set("name", kind.name);
  one.set("families", kind.families);
  return one;
}

/// The address of the last result's numbers, in the order in which fclib.js takes them.
int to_numbers(Result&& own) {
  // no structured binding: Clang 14 captures none
  Result& result = answer().result;
  std::vector<double>& numbers = answer().numbers;
  result = std::move(own);
  numbers = {static_cast<double>(result.status),
             static_cast<double>(result.iterations),
             result.error,
             result.cpu_s,
             result.setup_s,
             result.certificate.proven() ? 1.0 : 0.0};
  for_each_field<Solution>([&](const Field<Solution, Vector>& field) {
    const Vector& values = result.solution.*field.member;
    numbers.push_back(reinterpret_cast<int>(values.data()));
    numbers.push_back(static_cast<double>(values.size()));
  });
  numbers.push_back(static_cast<double>(result.stages.size()));
  for (const Stage& stage : result.stages) {
    for (const double one :
         {number_of(stage.kind), static_cast<double>(stage.calls),
          static_cast<double>(stage.solved), static_cast<double>(stage.iterations),
          static_cast<double>(stage.factorisations), stage.time}) {
      numbers.push_back(one);
    }
  }
  return reinterpret_cast<int>(numbers.data());
}

/// Another clock, for tests of code that reads the clock.
Clock clock_from(const val& clock) {
  if (is_missing(clock)) return {};
  return [clock] { return clock().as<double>(); };
}

/// The address of the result's numbers; 0 if there is a `failure` instead. The block has a
/// guess; `options`, `clock` and `report` may be undefined.
int solve_problem(int address, const std::string& solver, double tolerance, bool natural,
                  double max_iterations, double time_limit, bool history, const val& options,
                  const val& clock, const val& report) {
  int numbers = 0;
  answer().failure = failure_of([&] {
    Block block(address);
    const Problem problem = problem_from(block);
    const Solution guess{.r = vector_from(block)};
    Settings settings{.tolerance = tolerance,
                      .merit = natural ? MeritKind::natural : MeritKind::both,
                      .max_iterations = static_cast<std::int64_t>(max_iterations),
                      .time_limit = time_limit,
                      .clock = clock_from(clock),
                      .history = history};
    if (!report.isUndefined()) {
      settings.callback = [&](const Progress& progress) {
        const Vector* r = progress.r;
        return report(to_js(progress.iteration), progress.error, progress.time,
                      std::string(progress.stage),
                      r != nullptr ? reinterpret_cast<int>(r->data()) : 0,
                      r != nullptr ? static_cast<int>(r->size()) : 0)
            .template as<bool>();
      };
    }
    std::visit(
        [&](const auto& p) {
          numbers = to_numbers(solve(p, solver, settings, options_from(options), guess));
        },
        problem);
  });
  return numbers;
}

val failure_of_solve() { return std::exchange(answer().failure, val::undefined()); }

val certificate_of_solve() { return proof_to_js(answer().result.certificate); }

val history_of_solve() { return history_to_js(*answer().result.history); }

/// A copy of numbers that lie in the core's memory.
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
  function("failure", failure_of_solve);
  function("certificate", certificate_of_solve);
  function("history", history_of_solve);
  function("stage", known_stage);
  function("storage_of", number_of_storage);
  function("reserve", Block::reserve);
  function("numbers_at", numbers_at);
}

}  // namespace fclib::browser
