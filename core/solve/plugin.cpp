#include "solve/plugin.hpp"

#include <cfenv>
#include <cmath>
#include <cstddef>
#include <exception>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <utility>

#include <fclib_plugin.h>
#include "reduced/by_rows.hpp"

#if __has_include(<dlfcn.h>) && !defined(__EMSCRIPTEN__)
#include <dlfcn.h>
#define FCLIB_LOADS_PLUGINS
#endif
#ifdef __linux__
#include <link.h>

#include <cstring>
#include <fstream>
#endif

namespace fclib {

namespace {

using Function = decltype(&fclib_plugin_solve);
using Describe = decltype(&fclib_plugin_describe);

constexpr std::int64_t endless = 1'000'000;  // iterations, if the caller sets no limit

Error plugin_error(std::string_view name, const std::string& message) {
  return {ErrorKind::option, message, "solver '" + std::string(name) + "'"};
}

[[noreturn]] void bad_plugin(std::string_view name, const std::string& message) {
  throw plugin_error(name, message);
}

std::string text_of(const char* text) { return text != nullptr ? text : ""; }

/// Whether a text is UTF-8 (RFC 3629, section 4).
bool is_utf8(std::string_view text) {
  const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(text[k]); };
  for (std::size_t k = 0; k < text.size();) {
    const unsigned lead = byte(k);
    const std::size_t length = lead < 0x80 ? 1 : lead < 0xe0 ? 2 : lead < 0xf0 ? 3 : 4;
    if (length > 1 && (lead < 0xc2 || lead > 0xf4)) return false;
    if (length > text.size() - k) return false;
    for (std::size_t j = 1; j < length; ++j) {
      // the second byte excludes what is too long, surrogates, and what is beyond Unicode
      const unsigned least = j > 1 ? 0x80 : lead == 0xe0 ? 0xa0 : lead == 0xf0 ? 0x90 : 0x80;
      const unsigned most = j > 1 ? 0xbf : lead == 0xed ? 0x9f : lead == 0xf4 ? 0x8f : 0xbf;
      if (byte(k + j) < least || byte(k + j) > most) return false;
    }
    k += length;
  }
  return true;
}

/// A text that a plugin tells of itself. Throws Error (option) if it is not UTF-8.
std::string told_text(std::string_view plugin, const char* what, const char* text) {
  std::string told = text_of(text);
  if (!is_utf8(told)) bad_plugin(plugin, "its " + std::string(what) + " is not UTF-8");
  return told;
}

/// The modes of floating-point arithmetic (rounding, precision, traps, small numbers as zero) are
/// put back at the end of the scope. A plugin may change them, if only because it was compiled with
/// -Ofast, and its iterates are judged.
class ArithmeticScope {
 public:
  /// `inside`: the modes in the scope, if they are others than those before it.
  explicit ArithmeticScope(const std::fenv_t* inside = nullptr) {
    std::fegetenv(&before_);
    if (inside != nullptr) std::fesetenv(inside);
  }
  ~ArithmeticScope() { std::fesetenv(&before_); }
  ArithmeticScope(const ArithmeticScope&) = delete;
  ArithmeticScope& operator=(const ArithmeticScope&) = delete;

 private:
  std::fenv_t before_ = {};
};

/// What code of a plugin returns. If it throws, refusal(word) is thrown instead.
template <class Called, class Refusal>
auto unthrown(Called&& called, Refusal&& refusal) {
  const ArithmeticScope usual;
  std::string word = "something that is no exception";
  try {
    return called();
  } catch (const std::exception& error) {
    word = error.what();
  } catch (...) {  // the word tells it
  }
  throw refusal(word);
}

/// A call of a plugin: what its functions see. No exception passes through the plugin.
struct Call {
  const ReducedProblem& problem;
  const OptionValues& options;
  const std::vector<OptionInfo>& infos;
  Monitor monitor;
  Vector r = {};
  std::int64_t iterations = -1;  // the first report is the starting point
  std::optional<Status> reason = {};
  std::exception_ptr thrown = {};
  std::fenv_t usual = {};  // the modes in which an iterate is judged

  bool stop(const double* iterate) {
    const ArithmeticScope judging(&usual);
    try {
      if (iterate == nullptr) throw SolverError("stop() was given no iterate", "a plugin");
      ++iterations;
      r = Eigen::Map<const Vector>(iterate, problem.m());
      reason = monitor.report(iterations, error_of(problem, r), &r);
    } catch (...) {
      thrown = std::current_exception();
    }
    return thrown != nullptr || reason.has_value();
  }

  [[nodiscard]] double number(std::string_view name) const {
    const auto found = options.find(name);
    if (found == options.end()) return std::numeric_limits<double>::quiet_NaN();
    struct Reader {
      const std::vector<OptionInfo>& infos;
      std::string_view name;
      double operator()(bool value) const { return value ? 1 : 0; }
      double operator()(std::int64_t value) const { return static_cast<double>(value); }
      double operator()(double value) const { return value; }
      double operator()(const std::string& value) const {
        for (const OptionInfo& info : infos) {
          if (info.name == name && info.type == "choice") {
            return static_cast<double>(info.place_of(value));
          }
        }
        return std::numeric_limits<double>::quiet_NaN();
      }
    };
    return std::visit(Reader{infos, name}, found->second);
  }

  [[nodiscard]] const char* text(std::string_view name) const {
    const auto found = options.find(name);
    if (found == options.end()) return nullptr;
    const auto* value = std::get_if<std::string>(&found->second);
    return value != nullptr ? value->c_str() : nullptr;
  }
};

Outcome run(Function function, const std::string& name, const std::vector<OptionInfo>& infos,
            const ReducedProblem& problem, const OptionValues& values, const Settings& settings,
            Vector& r) {
  const OptionValues options = parse_options(infos, values);
  const Matrix W = by_rows(problem.W);
  Call call{problem, options, infos, Monitor(settings)};
  std::fegetenv(&call.usual);
  fclib_plugin_problem given{};
  given.size = sizeof given;
  given.spacedim = problem.d();
  given.contacts = problem.nc();
  given.start = W.p.data();
  given.column = W.i.data();
  given.value = W.x.data();
  given.q = problem.q.data();
  given.mu = problem.friction.mu.data();
  given.tolerance = settings.tolerance;
  given.stop = [](void* context, const double* iterate) {
    return static_cast<Call*>(context)->stop(iterate) ? 1 : 0;
  };
  given.context = &call;
  given.mu_r = problem.friction.mu_r.size() > 0 ? problem.friction.mu_r.data() : nullptr;
  given.number = [](void* context, const char* option) {
    return static_cast<Call*>(context)->number(text_of(option));
  };
  given.text = [](void* context, const char* option) {
    return static_cast<Call*>(context)->text(text_of(option));
  };
  const int code =
      unthrown([&] { return function(&given, r.data()); },
               [&](const std::string& word) {
                 return SolverError("fclib_plugin_solve threw: " + word, "solver " + name);
               });
  if (call.thrown) std::rethrow_exception(call.thrown);
  if (code != 0) {
    throw SolverError("fclib_plugin_solve returned " + std::to_string(code), "solver " + name);
  }
  return {.status = call.reason.value_or(Status::converged),
          .iterations = std::max<std::int64_t>(call.iterations, 0)};
}

/// An option as the plugin describes it. Throws Error (option) if it contradicts itself.
OptionInfo option_of(const fclib_plugin_option& told, std::string_view plugin) {
  const auto text = [&](const char* given) { return told_text(plugin, "option", given); };
  OptionInfo info{.name = text(told.name),
                  .type = text(told.type),
                  .default_value = text(told.value),
                  .unit = text(told.unit),
                  .doc = text(told.doc),
                  .choices = {}};
  if (told.lowest != 0 || told.highest != 0) {
    info.lowest = told.lowest;
    info.highest = told.highest;
  }
  for (const char* const* choice = told.choices; choice != nullptr && *choice != nullptr;
       ++choice) {
    info.choices.push_back(text(*choice));
  }
  constexpr std::string_view types[] = {"bool", "int", "float", "choice", "text"};
  if (std::find(std::begin(types), std::end(types), info.type) == std::end(types)) {
    bad_plugin(plugin, "its option " + info.name + " is of the type '" + info.type +
                           "', none of bool, int, float, choice, text");
  }
  try {
    info.default_value = parse_options({info}, {}).at(info.name);
  } catch (const Error& error) {
    bad_plugin(plugin, std::string("its default is wrong: ") + error.what());
  }
  return info;
}

#ifdef FCLIB_LOADS_PLUGINS

/// What a shared object exports under this name, with this type.
template <class Exported>
Exported exported(void* handle, const char* name) {
  return reinterpret_cast<Exported>(dlsym(handle, name));
}

/// Whether a shared object is shorter than it says, as half a copy is: to load it would end the
/// process.
bool is_cut_short(const std::filesystem::path& path) {
#ifdef __linux__
  std::ifstream file(path, std::ios::binary);
  const auto read = [&](auto& data) {
    return static_cast<bool>(file.read(reinterpret_cast<char*>(&data), sizeof data));
  };
  ElfW(Ehdr) header{};
  if (!read(header) || std::memcmp(header.e_ident, ELFMAG, SELFMAG) != 0) return false;
  std::error_code failed;
  const std::uintmax_t size = std::filesystem::file_size(path, failed);
  file.seekg(static_cast<std::streamoff>(header.e_phoff));
  for (int k = 0; k < header.e_phnum; ++k) {
    ElfW(Phdr) part{};
    if (!read(part)) return true;
    const bool beyond = part.p_offset > size || part.p_filesz > size - part.p_offset;
    if (part.p_type == PT_LOAD && beyond) return true;
  }
#else
  static_cast<void>(path);
#endif
  return false;
}

void* opened(std::string_view name) {
  const std::filesystem::path path(name.substr(plugin_prefix.size()));
  std::error_code failed;
  if (!std::filesystem::is_regular_file(path, failed)) bad_plugin(name, "there is no such file");
  if (is_cut_short(path)) bad_plugin(name, "cannot be loaded: the file is cut short");
  const auto whole = std::filesystem::absolute(path, failed);
  const ArithmeticScope usual;  // constructors of global objects run
  void* handle = dlopen(whole.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) bad_plugin(name, "cannot be loaded: " + text_of(dlerror()));
  return handle;
}

Solver entry_of(void* handle, std::string_view name) {
  const auto function = exported<Function>(handle, "fclib_plugin_solve");
  if (function == nullptr) {
    bad_plugin(name, "has no function fclib_plugin_solve (include/fclib_plugin.h)");
  }
  Solver entry{.name = std::string(name),
               .family = "plugin",
               .title = "A function of a shared object",
               .citation = {},
               .dimensions = {2, 3},
               .rolling_dimensions = {},
               .options = {},
               .max_iterations = endless,
               .solve = {},
               .origin = "plugin"};
  if (const auto describe = exported<Describe>(handle, "fclib_plugin_describe")) {
    const fclib_plugin_about* about = unthrown(describe, [&](const std::string& word) {
      return plugin_error(name, "fclib_plugin_describe threw: " + word);
    });
    if (about == nullptr || about->size < static_cast<int>(sizeof *about)) {
      bad_plugin(name, "fclib_plugin_describe returned no struct fclib_plugin_about with its size");
    }
    if (about->title != nullptr) entry.title = told_text(name, "title", about->title);
    entry.citation = told_text(name, "citation", about->citation);
    if (about->rolling != 0) entry.rolling_dimensions = {3, 5};
    for (const fclib_plugin_option* option = about->options;
         option != nullptr && option->name != nullptr; ++option) {
      entry.options.push_back(option_of(*option, name));
    }
  }
  entry.solve = [function, name = entry.name, options = entry.options](
                    const ReducedProblem& problem, const OptionValues& values,
                    const Settings& settings, Vector& r) {
    return run(function, name, options, problem, values, settings, r);
  };
  return entry;
}

#endif

}  // namespace

const Solver& load_plugin(std::string_view name) {
#ifdef FCLIB_LOADS_PLUGINS
  // the solver of what was loaded: by then, another file may be at this path
  static std::mutex guard;
  static std::map<std::pair<void*, std::string>, std::unique_ptr<const Solver>> loaded;
  const std::lock_guard lock(guard);
  void* handle = opened(name);
  std::unique_ptr<const Solver>& entry = loaded[{handle, std::string(name)}];
  if (entry) {
    dlclose(handle);  // the handle of the first load stays
  } else {
    entry = std::make_unique<const Solver>(entry_of(handle, name));
  }
  return *entry;
#else
  bad_plugin(name, "this system loads no shared objects");
#endif
}

}  // namespace fclib
