// Any bytes as an HDF5 file. Much of what it finds is inside of libhdf5: see README.md.
#include <hdf5.h>

#include "fuzz.hpp"
#include "io/hdf5/hdf5.hpp"
#include "io/replace_file.hpp"
#include "read_all.hpp"
#include "small_problems.hpp"

namespace fclib::fuzz {

namespace {

/// Copies a group, by the library's defaults: as libfclib 3.1 would have written it.
void copy_plainly(hid_t from, hid_t to) {
  H5Literate(
      from, H5_INDEX_NAME, H5_ITER_INC, nullptr,
      [](hid_t group, const char* name, const H5L_info_t*, void* data) -> herr_t {
        const hid_t target = *static_cast<hid_t*>(data);
        const hid_t object = H5Oopen(group, name, H5P_DEFAULT);
        if (H5Iget_type(object) == H5I_GROUP) {
          const hid_t created = H5Gcreate2(target, name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
          copy_plainly(object, created);
          H5Gclose(created);
        } else {
          const hid_t type = H5Dget_type(object);
          const hid_t space = H5Dget_space(object);
          const auto size = static_cast<std::size_t>(H5Sget_simple_extent_npoints(space));
          std::string values(size * H5Tget_size(type), '\0');
          H5Dread(object, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
          const hid_t created =
              H5Dcreate2(target, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
          H5Dwrite(created, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
          H5Dclose(created);
          H5Sclose(space);
          H5Tclose(type);
        }
        H5Oclose(object);
        return 0;
      },
      &to);
}

std::string copied_plainly(const std::string& path, H5F_libver_t version) {
  const std::string copy = (scratch() / "plain.hdf5").string();
  const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
  H5Pset_libver_bounds(access, version, H5F_LIBVER_LATEST);
  const hid_t source = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  const hid_t target = H5Fcreate(copy.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access);
  copy_plainly(source, target);
  H5Fclose(target);
  H5Fclose(source);
  H5Pclose(access);
  return read_file(copy);
}

std::vector<Input> seeds() {
  std::vector<Input> result;
  const std::string path = (scratch() / "seed.hdf5").string();
  for_each_small_problem([&](const std::string& name, const auto& problem) {
    const Solution solution = small_solution(problem);
    write_file(path, &problem, &solution);
    if (is_mixed(problem)) write_guesses(path, {solution});
    write_attributes(path, "solution", {{"error", 1e-9}, {"solver", std::string("nsgs")}});
    result.push_back({name, read_file(path)});
    // the old layout has no checksums, which changed bytes would fail
    result.push_back({name + "-plain", copied_plainly(path, H5F_LIBVER_EARLIEST)});
    if (problem.spacedim == 2) {
      result.push_back({name + "-latest", copied_plainly(path, H5F_LIBVER_LATEST)});
    }
  });
  return result;
}

void run(std::string_view bytes) {
  static const std::string path = (scratch() / "bytes.hdf5").string();
  put_file(path, bytes);
  read_all(path, writes_too(bytes));
}

}  // namespace

const Target hdf5_bytes{.name = "hdf5_bytes", .run = run, .seeds = seeds};

}  // namespace fclib::fuzz
