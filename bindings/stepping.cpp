// What fclib.simulate does in each step.
#include <nanobind/stl/string.h>

#include <algorithm>
#include <optional>
#include <type_traits>
#include <unordered_map>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "buffers.hpp"
#include "module.hpp"
#include "problem.hpp"
#include "stepping/contacts.hpp"
#include "stepping/joints.hpp"
#include "stepping/rest.hpp"
#include "stepping/rigid.hpp"
#include "stepping/servos.hpp"
#include "stepping/step.hpp"

namespace fclib::bindings {

using namespace nb::literals;

namespace {

using Tuple = nb::typed<nb::tuple, nb::any, nb::ellipsis>;
using Doubles = Buffer<const double>;
using Integers = Buffer<const std::int64_t>;
using Small = Buffer<const std::int32_t>;

/// An attribute of the name, which is text of the program. Python finds it without a search through
/// the classes only if the text is the same object each time.
nb::object attribute(nb::handle object, const char* name) {
  static std::unordered_map<const char*, PyObject*> known;
  PyObject*& text = known[name];
  if (text == nullptr) text = PyUnicode_InternFromString(name);
  PyObject* const found = text == nullptr ? nullptr : PyObject_GetAttr(object.ptr(), text);
  if (found == nullptr) throw nb::python_error();
  return nb::steal(found);
}

/// NumPy's function `empty`, looked up once.
nb::handle empty() {
  static const nb::handle found = nb::object(nb::module_::import_("numpy").attr("empty")).release();
  return found;
}

/// A type of numbers of NumPy, looked up once.
template <class Number>
nb::handle dtype() {
  const char* const name = std::is_same_v<Number, double>         ? "float64"
                           : std::is_same_v<Number, std::int64_t> ? "int64"
                                                                  : "int32";
  static const nb::handle found =
      nb::object(nb::module_::import_("numpy").attr("dtype")(name)).release();
  return found;
}

/// A new array of NumPy of some shape.
template <class Number>
nb::object new_array(const nb::tuple& shape) {
  return empty()(shape, dtype<Number>());
}

/// A new array of NumPy, with axes after the first one. It is filled by a copy: an array that keeps
/// its owner takes longer than the numbers of a few bodies.
template <class Number>
nb::object array_of(const std::vector<Number>& values, std::size_t second = 1,
                    std::size_t third = 1) {
  const std::size_t rows = values.size() / (second * third);
  const nb::object made = new_array<Number>(third > 1    ? nb::make_tuple(rows, second, third)
                                            : second > 1 ? nb::make_tuple(rows, second)
                                                         : nb::make_tuple(rows));
  const Buffer<Number> buffer(made);
  std::copy(values.begin(), values.end(), buffer.data());
  return made;
}

template <class Number>
nb::object maybe_array_of(const std::optional<std::vector<Number>>& values) {
  return values ? array_of(*values) : nb::none();
}

/// data, indices and indptr of SciPy's matrix by columns
Tuple arrays_of(const Matrix& a) {
  return Tuple(nb::make_tuple(array_of(a.x), array_of(a.i), array_of(a.p)));
}

/// Indices of 32 bits: those of SciPy are longer if it made them so.
nb::object indices_of(nb::handle matrix, const char* name) {
  nb::object indices = attribute(matrix, name);
  if (nb::cast<int>(attribute(indices, "itemsize")) == 4) return indices;
  return indices.attr("astype")("int32");
}

/// Throws ValueError if an array has not the size that the others ask for.
void require(bool fits, const char* what) {
  if (!fits) throw nb::value_error((std::string(what) + ": does not fit the other arrays").c_str());
}

/// Whether all numbers are from 0 on, and below a bound.
template <class Number>
bool are_below(std::span<const Number> numbers, std::size_t bound) {
  return std::all_of(numbers.begin(), numbers.end(), [bound](Number number) {
    return number >= 0 && static_cast<std::size_t>(number) < bound;
  });
}

/// A csc_array of SciPy, of so many rows.
class Given {
 public:
  Given(nb::handle matrix, std::size_t rows, const char* what)
      : data_(attribute(matrix, "data"), what),
        index_(indices_of(matrix, "indices"), what),
        pointer_(indices_of(matrix, "indptr"), what),
        rows_(static_cast<Index>(rows)) {
    const auto pointers = pointer_.all();
    require(
        !pointers.empty() && pointers.front() == 0 &&
            std::is_sorted(pointers.begin(), pointers.end()) &&
            static_cast<std::size_t>(pointers.back()) <= std::min(data_.rows(), index_.rows()) &&
            are_below(index_.all(), rows),
        what);
  }

  /// Throws ValueError if it has not so many columns.
  const Given& of(std::size_t columns, const char* what) const {
    require(pointer_.rows() == columns + 1, what);
    return *this;
  }
  [[nodiscard]] std::size_t columns() const { return pointer_.rows() - 1; }

  operator stepping::Columns() const {
    return {rows_, static_cast<Index>(pointer_.rows()) - 1, pointer_.all().data(),
            index_.all().data(), data_.all().data()};
  }

 private:
  Doubles data_;
  Small index_, pointer_;
  Index rows_;
};

template <class Number>
stepping::Table<Number> table_of(const Buffer<const Number>& buffer) {
  if (!buffer.has_whole_rows()) throw nb::type_error("a table's rows are not contiguous");
  return {buffer.data(), buffer.step()};
}

Tuple active_contacts(nb::handle H, nb::handle M, nb::handle v, nb::handle force, nb::handle pair,
                      nb::handle point, nb::handle gap, int d, double h, bool allowance,
                      double rounding, double motion, nb::handle surface, double activation,
                      int face, double restitution) {
  const Doubles speeds(v, "v"), forces(force, "force"), points(point, "point"), gaps(gap, "gap");
  const Integers pairs(pair, "pair");
  const Given by_contacts(H, speeds.rows(), "H"), mass(M, speeds.rows(), "M");
  std::optional<Doubles> surfaces;
  const std::size_t nc = gaps.rows();
  require(pairs.all().size() == 2 * nc, "pair");
  require(points.all().size() == 3 * nc, "point");
  require(forces.rows() == speeds.rows(), "force");
  by_contacts.of(nc * static_cast<std::size_t>(d), "H");
  mass.of(speeds.rows(), "M");
  stepping::Reach reach;
  reach.d = d;
  reach.H = by_contacts;
  reach.M = mass;
  reach.v = speeds.all();
  reach.force = forces.all();
  reach.pair = pairs.all();
  reach.point = points.all();
  reach.gap = gaps.all();
  reach.h = h;
  reach.allowance = allowance;
  reach.rounding = rounding;
  reach.motion = motion;
  if (!surface.is_none()) {
    reach.surface = surfaces.emplace(surface, "surface").all();
    for (std::size_t c = 0; c < nc; ++c) {
      const auto own = reach.pair.subspan(2 * c, 2);
      require(own[0] < 0 || are_below(own, reach.surface.size()), "surface");
    }
  }
  reach.activation = activation;
  reach.face = face;
  stepping::Active found = stepping::active_contacts(reach);
  nb::list crowded;
  for (auto& own : found.crowded) {
    std::vector<double> closed;
    for (const auto place : own) closed.push_back(found.closed[static_cast<std::size_t>(place)]);
    crowded.append(nb::make_tuple(array_of(own), array_of(closed)));
  }
  for (double& speed : found.before) speed *= restitution;
  return Tuple(nb::make_tuple(array_of(found.which), array_of(found.before), crowded));
}

Vector vector_of(std::vector<double> values) {
  return Eigen::Map<const Vector>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// A problem of the kind P, without coefficients of friction.
template <class P>
P problem_of(stepping::Equations&& equations, int d, const ProblemInfo& info) {
  P problem;
  problem.spacedim = d;
  problem.M = std::move(equations.M);
  problem.H = std::move(equations.H);
  if (equations.G.cols > 0) problem.G = std::move(equations.G);
  problem.f = vector_of(std::move(equations.f));
  problem.w = vector_of(std::move(equations.w));
  problem.b = vector_of(std::move(equations.b));
  problem.info = info;
  return problem;
}

Tuple step_problem(int d, double h, double theta, nb::handle M, nb::handle C, nb::handle K,
                   nb::handle H, nb::handle G, nb::handle force, nb::handle v, nb::handle violation,
                   double undone, nb::handle w, nb::handle active, nb::handle tree, nb::handle dry,
                   nb::handle driven, bool all_bodies, nb::handle mu, nb::handle mu_r,
                   nb::handle mu_s, const ProblemInfo& info) {
  const Doubles forces(force, "force"), speeds(v, "v"), violations(violation, "violation"),
      normals(w, "w");
  const Integers trees(tree, "tree");
  const std::size_t n = speeds.rows();
  const Given mass(M, n, "M"), damping(C, n, "C"), stiffness(K, n, "K"), contacts(H, n, "H"),
      joints(G, n, "G");
  stepping::System system;
  system.d = d;
  system.h = h;
  system.theta = theta;
  system.M = mass;
  system.C = damping;
  system.K = stiffness;
  system.H = contacts;
  system.G = joints;
  system.force = forces.all();
  system.v = speeds.all();
  std::vector<double> sides(violations.all().begin(), violations.all().end());
  for (double& side : sides) side *= undone;
  system.b = sides;
  system.w = normals.all();
  system.tree = trees.all();
  system.all_bodies = all_bodies;
  std::optional<Integers> chosen, given;
  std::optional<Doubles> bound, inertia, velocity;
  std::optional<Given> gradient;
  if (!active.is_none()) system.active = chosen.emplace(active, "active").all();
  if (!dry.is_none()) {
    auto& own = system.dry.emplace();
    own.gradient = gradient.emplace(attribute(dry, "gradient"), n, "gradient");
    own.bound = bound.emplace(attribute(dry, "bound"), "bound").all();
    own.mass = inertia.emplace(attribute(dry, "mass"), "mass").all();
  }
  if (!driven.is_none()) {
    auto& own = system.driven.emplace();
    own.dof = given.emplace(attribute(driven, "dof"), "dof").all();
    own.velocity = velocity.emplace(attribute(driven, "velocity"), "velocity").all();
  }
  const std::size_t nc = contacts.columns() / static_cast<std::size_t>(d);
  const std::size_t more = system.dry ? system.dry->bound.size() : 0;
  for (const Given* const matrix : {&mass, &damping, &stiffness}) matrix->of(n, "M, C or K");
  contacts.of(nc * static_cast<std::size_t>(d), "H");
  joints.of(system.b.size(), "G");
  require(forces.rows() == n && trees.rows() == n, "force or tree");
  require(std::all_of(system.tree.begin(), system.tree.end(), [](auto k) { return k >= 0; }),
          "tree");
  require(!system.active || are_below(*system.active, nc), "active");
  require(normals.rows() == (system.active ? system.active->size() : nc), "w");
  if (system.dry) {
    gradient->of(more, "gradient");
    require(inertia->rows() == more, "mass");
  }
  require(!system.driven || (are_below(system.driven->dof, n) && velocity->rows() == given->rows()),
          "driven");
  stepping::Step step = stepping::step_of(system);

  const auto coefficients = [&](nb::handle values, const char* name) {
    const Doubles all(values, name);
    require(all.rows() == normals.rows() + more, name);
    std::vector<double> found(all.all().begin(), all.all().end());
    if (step.touching) {
      std::vector<double> kept;
      for (const auto c : *step.touching) kept.push_back(found[static_cast<std::size_t>(c)]);
      found = std::move(kept);
    }
    return vector_of(std::move(found));
  };
  nb::object dofs = maybe_array_of(step.problem.dofs);
  nb::object problem;
  const auto make = [&]<class P>(std::type_identity<P>) {
    P made = problem_of<P>(std::move(step.problem), d, info);
    made.mu = coefficients(mu, "mu");
    if constexpr (P::rolling || P::spin) {
      if (!mu_r.is_none()) made.mu_r = coefficients(mu_r, "mu_r");
    }
    if constexpr (P::spin) {
      made.mu_s = coefficients(mu_s, "mu_s");
      // sliding and spin share their limit; with rolling each has its own
      made.coupled = mu_r.is_none() ? 1 : 0;
    }
    problem = nb::cast(std::move(made));
  };
  if (!mu_s.is_none()) {
    make(std::type_identity<GlobalSpinProblem>{});
  } else if (!mu_r.is_none()) {
    make(std::type_identity<GlobalRollingProblem>{});
  } else {
    make(std::type_identity<GlobalProblem>{});
  }
  nb::object rest = nb::none();
  if (step.rest) {
    rest = nb::make_tuple(arrays_of(step.rest->M), arrays_of(step.rest->G), array_of(step.rest->f),
                          array_of(step.rest->b), maybe_array_of(step.rest->dofs));
  }
  return Tuple(nb::make_tuple(problem, dofs, maybe_array_of(step.touching), rest));
}

Tuple contact_table(nb::handle data, nb::handle contact, nb::handle length, nb::handle column,
                    nb::handle value, int n, bool spin, bool rolling, double least) {
  const Small lengths(length, "length"), columns(column, "column");
  const Doubles values(value, "value");
  const Small address(attribute(contact, "efc_address"), "efc_address"),
      shape(attribute(contact, "geom"), "geom"), dim(attribute(contact, "dim"), "dim"),
      kind(attribute(data, "efc_type"), "efc_type"), number(attribute(data, "efc_id"), "efc_id");
  const Doubles friction(attribute(contact, "friction"), "friction"),
      gap(attribute(contact, "dist"), "dist"), point(attribute(contact, "pos"), "pos"),
      frame(attribute(contact, "frame"), "frame"), position(attribute(data, "efc_pos"), "efc_pos");
  const auto count = [&](const char* name) { return nb::cast<std::size_t>(attribute(data, name)); };
  stepping::ContactTable made = stepping::contacts_of(
      {n, lengths.all(), columns.all(), values.all()},
      {address.rows(), table_of(address), table_of(shape), table_of(dim), table_of(friction),
       table_of(gap), table_of(point), table_of(frame)},
      {count("ne") + count("nf"), count("nl"), kind.all(), number.all(), position.all()},
      {spin, rolling, least});
  return Tuple(nb::make_tuple(arrays_of(made.H), array_of(made.pair, 2), array_of(made.point, 3),
                              array_of(made.frame, 3, 3), array_of(made.gap), array_of(made.mu),
                              rolling ? array_of(made.mu_r) : nb::none(),
                              spin ? array_of(made.mu_s) : nb::none()));
}

nb::object set_margins(nb::handle model, nb::handle speed, double h, double fall, nb::handle slack,
                       nb::handle own, nb::handle owner, nb::handle first) {
  const Doubles speeds(speed, "speed"), slacks(slack, "slack"), margins(own, "own");
  const Integers owners(owner, "owner"), firsts(first, "first");
  const Buffer<double> geometries(attribute(model, "geom_margin"), "geom_margin"),
      bodies(attribute(model, "body_margin"), "body_margin");
  const std::size_t count = geometries.rows();
  require(speeds.rows() == count && slacks.rows() == count && margins.rows() == count, "speed");
  require(owners.rows() == firsts.rows() && are_below(owners.all(), bodies.rows()) &&
              are_below(firsts.all(), count),
          "owner");
  std::vector<double> reach(count);
  for (std::size_t g = 0; g < count; ++g) {
    reach[g] = h * speeds.data()[g] + fall + slacks.data()[g];
  }
  stepping::set_margins(margins.all(), reach, owners.all(), firsts.all(),
                        {geometries.all(), bodies.all()});
  return array_of(reach);
}

/// Some rows of an array, or all, and `more` rows of another one, or zeros.
template <class Number>
nb::object rows_of_one(nb::handle array, const std::optional<Integers>& which, nb::handle other,
                       std::size_t more) {
  const Buffer<const Number> own(array);
  const std::span<const Number> values = own.all();
  const std::size_t count = which ? which->rows() : own.rows();
  nb::list shape;
  shape.append(count + more);
  std::size_t length = 1;
  for (const Py_ssize_t axis : own.axes()) {
    shape.append(axis);
    length *= static_cast<std::size_t>(axis);
  }
  const nb::object made = new_array<Number>(nb::tuple(shape));
  const Buffer<Number> buffer(made);
  Number* to = buffer.data();
  if (which) {
    require(are_below(which->all(), own.rows()), "which");
    for (const std::int64_t row : which->all()) {
      const auto part = values.subspan(static_cast<std::size_t>(row) * length, length);
      to = std::copy(part.begin(), part.end(), to);
    }
  } else {
    to = std::copy(values.begin(), values.end(), to);
  }
  if (other.is_none()) {
    std::fill_n(to, more * length, Number(0));
  } else {
    const Buffer<const Number> last(other, "array");
    require(last.all().size() == more * length, "others");
    std::copy(last.all().begin(), last.all().end(), to);
  }
  return made;
}

nb::list rows_of(const nb::tuple& arrays, nb::handle which, nb::handle others) {
  std::optional<Integers> chosen;
  if (!which.is_none()) chosen.emplace(which, "which");
  std::size_t more = 0;
  if (!others.is_none()) more = nb::len(nb::object(others[0]));
  nb::list found;
  for (std::size_t k = 0; k < arrays.size(); ++k) {
    const nb::object array = arrays[k];
    if (array.is_none()) {
      found.append(nb::none());
      continue;
    }
    const nb::object other = others.is_none() ? nb::none() : nb::object(others[k]);
    const nb::object type = attribute(array, "dtype");
    if (type.is(dtype<double>())) {
      found.append(rows_of_one<double>(array, chosen, other, more));
    } else if (type.is(dtype<std::int64_t>())) {
      found.append(rows_of_one<std::int64_t>(array, chosen, other, more));
    } else {
      throw nb::type_error("an array of other numbers");
    }
  }
  return found;
}

/// A global problem of any law. TypeError for others.
const GlobalProblem& global(nb::handle object) {
  const GlobalProblem* found = nullptr;
  for_each_formulation([&]<class P>(std::type_identity<P>) {
    if constexpr (std::is_base_of_v<GlobalProblem, P>) {
      if (nb::isinstance<P>(object)) found = &nb::cast<const P&>(object);
    }
  });
  if (found == nullptr) throw nb::type_error("not a global problem");
  return *found;
}

/// fclib.simulate.servos.Servos, with the moments in MuJoCo's data.
class GivenServos {
 public:
  GivenServos(nb::handle servos, nb::handle data)
      : start_(attribute(data, "moment_rowadr"), "moment_rowadr"),
        length_(attribute(data, "moment_rownnz"), "moment_rownnz"),
        column_(attribute(data, "moment_colind"), "moment_colind"),
        moment_(attribute(data, "actuator_moment"), "actuator_moment"),
        stiffness_(attribute(servos, "stiffness"), "stiffness"),
        damping_(attribute(servos, "damping"), "damping"),
        low_(attribute(servos, "low"), "low"),
        high_(attribute(servos, "high"), "high"),
        joint_low_(attribute(servos, "joint_low"), "joint_low"),
        joint_high_(attribute(servos, "joint_high"), "joint_high"),
        springs_(attribute(servos, "springs"), "springs"),
        dampers_(attribute(servos, "dampers"), "dampers") {
    moments = {start_.all(), length_.all(), column_.all(), moment_.all()};
    all.stiffness = stiffness_.all();
    all.damping = damping_.all();
    all.low = low_.all();
    all.high = high_.all();
    all.joint_low = joint_low_.all();
    all.joint_high = joint_high_.all();
    all.springs = springs_.all();
    all.dampers = dampers_.all();
    for (const nb::handle tendon : attribute(servos, "tendons")) {
      const Integers outputs(tendon[0], "tendons");
      auto& own = all.tendons.emplace_back();
      own.outputs.assign(outputs.all().begin(), outputs.all().end());
      own.low = nb::cast<double>(tendon[1]);
      own.high = nb::cast<double>(tendon[2]);
    }
  }

  stepping::Servos all;
  stepping::Moments moments;

 private:
  Small start_, length_, column_;
  Doubles moment_, stiffness_, damping_, low_, high_, joint_low_, joint_high_, springs_, dampers_;
};

}  // namespace

void bind_stepping(nb::module_& m) {
  // fclib.simulate hands over arrays of the right sizes
  m.def(
      "active_contacts", &active_contacts, "H"_a, "M"_a, "v"_a, "force"_a, "pair"_a, "point"_a,
      "gap"_a, "d"_a, "h"_a, "allowance"_a, "rounding"_a, "motion"_a, "surface"_a.none(),
      "activation"_a, "face"_a, "restitution"_a,
      "The active contacts of a step by the velocity law, their normal velocities before it times\n"
      "the restitution, and for each pair of more than `face` points: their places among the\n"
      "active ones, and their gaps that count as closed.");
  m.def("step_problem", &step_problem, "d"_a, "h"_a, "theta"_a, "M"_a, "C"_a, "K"_a, "H"_a, "G"_a,
        "force"_a, "v"_a, "violation"_a, "undone"_a, "w"_a, "active"_a.none(), "tree"_a,
        "dry"_a.none(), "driven"_a.none(), "all_bodies"_a, "mu"_a, "mu_r"_a.none(), "mu_s"_a.none(),
        "info"_a,
        "The problem of a step, with b of so many times the violation; its degrees of freedom in "
        "the\n"
        "system (None: all); the contacts that it has (None: all); and M, G, f, b and degrees of\n"
        "freedom of what moves freely (or None).");
  m.def("contact_table", &contact_table, "data"_a, "contact"_a, "length"_a, "column"_a, "value"_a,
        "n"_a, "spin"_a, "rolling"_a, "least"_a,
        "H, pair, point, frame, gap, mu, mu_r and mu_s of MuJoCo's contacts and limits, from the\n"
        "rows of its Jacobian.");
  m.def(
      "speeds_of",
      [](nb::handle twist, nb::handle body, nb::handle centre, nb::handle root, nb::handle place,
         nb::handle radius) {
        const Doubles twists(twist, "twist"), centres(centre, "centre"), places(place, "place"),
            radii(radius, "radius");
        const Integers bodies(body, "body"), roots(root, "root");
        std::vector<double> speed(radii.rows());
        stepping::speeds_of(twists.all(), bodies.all(), centres.all(), roots.all(), places.all(),
                            radii.all(), speed);
        return array_of(speed);
      },
      "twist"_a, "body"_a, "centre"_a, "root"_a, "place"_a, "radius"_a,
      nb::sig("def speeds_of(twist: object, body: object, centre: object, root: object, place: "
              "object, radius: object) -> numpy.typing.NDArray[numpy.float64]"),
      "The speed of each geometry that none of its points exceeds.");
  m.def(
      "set_margins", &set_margins, "model"_a, "speed"_a, "h"_a, "fall"_a, "slack"_a, "own"_a,
      "owner"_a, "first"_a,
      nb::sig("def set_margins(model: object, speed: object, h: float, fall: float, slack: object, "
              "own: object, owner: object, first: object) -> numpy.typing.NDArray[numpy.float64]"),
      "Sets the margins of geometries, and of the bodies that own them, to their reach within h,\n"
      "or to their own margins if these are larger. The reach, which is returned, is what their\n"
      "speeds move, `fall` [m] and the slack.");
  m.def(
      "other_forces",
      [](nb::handle data) {
        const Doubles passive(attribute(data, "qfrc_passive"), "qfrc_passive"),
            applied(attribute(data, "qfrc_applied"), "qfrc_applied"),
            bias(attribute(data, "qfrc_bias"), "qfrc_bias"),
            pushes(attribute(data, "xfrc_applied"), "xfrc_applied");
        require(applied.rows() == passive.rows() && bias.rows() == passive.rows(), "force");
        std::vector<double> force(passive.rows());
        for (std::size_t k = 0; k < force.size(); ++k) {
          force[k] = passive.data()[k] + applied.data()[k] - bias.data()[k];
        }
        const auto all = pushes.all();
        const bool pushed = std::any_of(all.begin(), all.end(), [](double x) { return x != 0; });
        return Tuple(nb::make_tuple(array_of(force), pushed));
      },
      "data"_a,
      "MuJoCo's passive and applied forces minus its bias, and whether bodies are pushed besides.");
  m.def(
      "not_between",
      [](nb::handle points, nb::handle off) {
        const Doubles places(points, "points"), lengths(off, "off");
        nb::list found;
        for (const auto kept : stepping::not_between(places.all(), lengths.all())) {
          found.append(nb::bool_(kept != 0));
        }
        return found;
      },
      "points"_a, "off"_a, nb::sig("def not_between(points: object, off: object) -> list[bool]"),
      "Which of k points (k x 3) are not on a line between two others, within off (k).");
  m.def(
      "same_contacts",
      [](nb::handle old_pair, nb::handle old_place, nb::handle pair, nb::handle place) {
        const Integers olds(old_pair, "pair"), news(pair, "pair");
        const Doubles before(old_place, "place"), now(place, "place");
        require(now.all().size() == 3 * news.all().size(), "place");
        return array_of(stepping::same_contacts(olds.all(), before.all(), news.all(), now.all()));
      },
      "old_pair"_a, "old_place"_a, "pair"_a, "place"_a,
      nb::sig("def same_contacts(old_pair: object, old_place: object, pair: object, place: object) "
              "-> numpy.typing.NDArray[numpy.int64]"),
      "The contact of the step before that each one continues; -1 for none.");
  m.def(
      "carried_over",
      [](nb::handle r, nb::handle source, nb::handle before, nb::handle now, int force, int axis) {
        const Doubles reactions(r, "r"), olds(before, "frame"), news(now, "frame");
        const Integers sources(source, "source");
        const std::size_t count = reactions.rows();
        require(olds.all().size() == 9 * count, "frame");
        require(news.all().size() == 9 * sources.rows(), "frame");
        require(std::all_of(sources.all().begin(), sources.all().end(),
                            [count](auto k) { return k < static_cast<std::int64_t>(count); }),
                "source");
        return array_of(stepping::carried_over(
            reactions.all(), count > 0 ? reactions.all().size() / count : 1, sources.all(),
            olds.all(), news.all(), static_cast<std::size_t>(force),
            static_cast<std::size_t>(axis)));
      },
      "r"_a, "source"_a, "before"_a, "now"_a, "force"_a, "axis"_a,
      nb::sig("def carried_over(r: object, source: object, before: object, now: object, force: "
              "int, axis: int) -> numpy.typing.NDArray[numpy.float64]"),
      "Reactions of another step in the frames of the contacts that continue them.");
  m.def(
      "places_on_shapes",
      [](nb::handle point, nb::handle pair, nb::handle place, nb::handle turn, double x, double y) {
        const Doubles points(point, "point"), places(place, "place"), turns(turn, "turn");
        const Integers pairs(pair, "pair");
        require(pairs.all().size() == 2 * points.rows(), "pair");
        for (std::size_t c = 0; c < points.rows(); ++c) {
          const auto own = pairs.all().subspan(2 * c, 2);
          require(own[0] < 0 || are_below(own, places.rows()), "pair");
        }
        const nb::object made = new_array<double>(nb::make_tuple(points.rows(), 2, 3));
        const Buffer<double> found(made);
        stepping::places_on_shapes(points.all(), pairs.all(), places.all(), turns.all(), {x, y},
                                   found.all());
        return made;
      },
      "point"_a, "pair"_a, "place"_a, "turn"_a, "x"_a, "y"_a,
      nb::sig("def places_on_shapes(point: object, pair: object, place: object, turn: object, x: "
              "float, y: float) -> numpy.typing.NDArray[numpy.float64]"),
      "Points (nc x 3) in the frames of their two shapes (nc x 2 x 3); 0 for limits.");
  m.def(
      "are_within",
      [](nb::handle values, double bound) {
        const Doubles own(values, "values");
        const auto all = own.all();
        return std::all_of(all.begin(), all.end(),
                           [bound](double value) { return std::abs(value) < bound; });
      },
      "values"_a, "bound"_a, nb::sig("def are_within(values: object, bound: float) -> bool"),
      "Whether all numbers are finite and of a size below a bound.");
  m.def(
      "chosen_entries",
      [](nb::handle values, nb::handle entry, nb::handle row, nb::handle pointer) {
        const Doubles all(values, "values");
        const Integers entries(entry, "entry");
        const Small rows(row, "row"), pointers(pointer, "pointer");
        const auto starts = pointers.all();
        require(are_below(entries.all(), all.rows()), "entry");
        require(rows.rows() == entries.rows() && !starts.empty() && starts.front() == 0 &&
                    std::is_sorted(starts.begin(), starts.end()) &&
                    static_cast<std::size_t>(starts.back()) == entries.rows() &&
                    are_below(rows.all(), starts.size() - 1),
                "row");
        return arrays_of(stepping::chosen_entries(all.all(), entries.all(), rows.all(), starts,
                                                  static_cast<Index>(starts.size()) - 1));
      },
      "values"_a, "entry"_a, "row"_a, "pointer"_a,
      "A square matrix by columns of some of the values, without those that are 0.");
  m.def("rows_of", &rows_of, "arrays"_a, "which"_a.none(), "others"_a.none(),
        nb::sig("def rows_of(arrays: tuple[object, ...], which: object, others: tuple[object, ...] "
                "| None) -> list[typing.Any]"),
        "Some rows of each array, or all, with those of others after them: zeros if it is None.");
  m.def(
      "bilateral_rows",
      [](nb::handle data, int n, nb::handle group, nb::handle rounding, double rank) {
        const Small lengths(attribute(data, "efc_J_rownnz"), "length"),
            columns(attribute(data, "efc_J_colind"), "column");
        const Doubles values(attribute(data, "efc_J"), "value"), blurs(rounding, "rounding");
        const Integers groups(group, "group");
        const stepping::Rows rows{n, lengths.all(), columns.all(), values.all()};
        const auto kept = stepping::rows_that_count(rows, groups.all(), blurs.all(), rank);
        return Tuple(
            nb::make_tuple(array_of(kept), arrays_of(stepping::columns_of_rows(rows, kept))));
      },
      "data"_a, "n"_a, "group"_a, "rounding"_a, "rank"_a,
      "Which of MuJoCo's first rows are not zero beside others of their group, and these as "
      "columns.");
  m.def(
      "are_independent",
      [](nb::handle G, int n, nb::handle violation, nb::handle rounding, double rank, double own,
         double turned, double singular) {
        const Given columns(G, static_cast<std::size_t>(n), "G");
        const Doubles violations(violation, "violation"), blurs(rounding, "rounding");
        columns.of(violations.rows(), "G").of(blurs.rows(), "G");
        return stepping::are_independent(columns, violations.all(), blurs.all(),
                                         {rank, own, turned, singular});
      },
      "G"_a, "n"_a, "violation"_a, "rounding"_a, "rank"_a, "own"_a, "turned"_a, "singular"_a,
      nb::sig("def are_independent(G: object, n: int, violation: object, rounding: object, rank: "
              "float, own: float, turned: float, singular: float) -> bool"),
      "Whether no column of G follows from others.");
  m.def(
      "solution_of",
      [](nb::handle A, nb::handle b) {
        const Vector side = vector_from(b, "b");
        const Given columns(A, static_cast<std::size_t>(side.size()), "A");
        columns.of(static_cast<std::size_t>(side.size()), "A");
        const Vector x = stepping::solution_of(columns, side);
        return array_of(std::vector<double>(x.data(), x.data() + x.size()));
      },
      "A"_a, "b"_a,
      nb::sig("def solution_of(A: object, b: object) -> numpy.typing.NDArray[numpy.float64]"),
      "x with A x = b, for a matrix by columns.");
  m.def(
      "servo_matrices",
      [](nb::handle servos, nb::handle data) {
        const GivenServos given(servos, data);
        const stepping::Linear made = stepping::linear_of(given.all, given.moments);
        return Tuple(nb::make_tuple(arrays_of(made.C), arrays_of(made.K)));
      },
      "servos"_a, "data"_a, "Damping and stiffness of joints and servos, if none is at a limit.");
  m.def(
      "servo_forces",
      [](nb::handle servos, nb::handle data, double h, nb::handle M, nb::handle other) {
        const GivenServos given(servos, data);
        const Doubles raw(attribute(data, "actuator_force"), "actuator_force"),
            whole(attribute(data, "qfrc_actuator"), "qfrc_actuator"),
            v(attribute(data, "qvel"), "qvel"), forces(other, "other");
        const Given mass(M, v.rows(), "M");
        const stepping::Limited made = stepping::within_limits(
            given.all, given.moments, raw.all(), whole.all(), mass, forces.all(), v.all(), h);
        return Tuple(nb::make_tuple(array_of(made.force), arrays_of(made.linear.C),
                                    arrays_of(made.linear.K)));
      },
      "servos"_a, "data"_a, "h"_a, "M"_a, "other"_a,
      "The force of all actuators in a step, and damping and stiffness without those at a limit.");
  m.def(
      "nearest_at_rest",
      [](nb::handle problem, const Solution& solution, nb::handle r, double still) -> nb::object {
        const Vector wanted = vector_from(r, "r");
        const GlobalProblem& own = global(problem);
        for (const Vector* const values : {&wanted, &solution.r, &solution.u}) {
          require(values->size() == own.size(Dim::m), "r or u");
        }
        const auto found = stepping::nearest_at_rest(own, solution, wanted, still);
        if (!found) return nb::none();
        return array_of(std::vector<double>(found->data(), found->data() + found->size()));
      },
      "problem"_a, "solution"_a, "r"_a, "still"_a,
      nb::sig("def nearest_at_rest(problem: object, solution: object, r: object, still: float) -> "
              "numpy.typing.NDArray[numpy.float64] | None"),
      "The reactions nearest to r of bodies at rest, without the cones; None if bodies move.");
  m.def(
      "moving_part",
      [](nb::handle H, int n, nb::handle change) {
        const Vector wanted = vector_from(change, "change");
        const Given columns(H, static_cast<std::size_t>(n), "H");
        columns.of(static_cast<std::size_t>(wanted.size()), "H");
        const Vector part = stepping::moving_part(columns, wanted);
        return array_of(std::vector<double>(part.data(), part.data() + part.size()));
      },
      "H"_a, "n"_a, "change"_a,
      nb::sig("def moving_part(H: object, n: int, change: object) -> "
              "numpy.typing.NDArray[numpy.float64]"),
      "The part of a change of reactions that moves bodies.");
}

}  // namespace fclib::bindings
