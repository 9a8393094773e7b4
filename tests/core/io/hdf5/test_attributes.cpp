#include "io/hdf5/attributes.hpp"

#include <gtest/gtest.h>
#include <hdf5.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "temporary_folder.hpp"

namespace fclib {
namespace {

namespace fs = std::filesystem;

LocalProblem no_contacts() {
  LocalProblem problem;
  problem.W.storage = Storage::dense;
  return problem;
}

/// Files in a folder of its own.
class Attached : public ::testing::Test {
 protected:
  Attached() {
    const LocalProblem problem = no_contacts();
    write_file(path(), &problem);
  }

  [[nodiscard]] std::string path(const std::string& name = "problem.hdf5") const {
    return (folder_.path() / name).string();
  }
  [[nodiscard]] std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_.path()), {}));
  }
  [[nodiscard]] std::string bytes() const {
    std::ifstream stream(path(), std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  /// Gives the info of the problem an attribute, as another program may.
  void attach(const char* name, hid_t type, hid_t space, const void* value) const {
    const hid_t file = H5Fopen(path().c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t group = H5Gopen2(file, "fclib_local/info", H5P_DEFAULT);
    const hid_t attribute = H5Acreate2(group, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
    EXPECT_GE(H5Awrite(attribute, type, value), 0);
    H5Aclose(attribute);
    H5Gclose(group);
    H5Fclose(file);
  }
  template <class Write>
  static std::string message_of(const Write& write) {
    try {
      write();
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

 private:
  testing::TemporaryFolder folder_;
};

TEST_F(Attached, WhatIsNeitherOneNumberNorOneTextIsLeftOut) {
  const hid_t one = H5Screate(H5S_SCALAR);
  const hsize_t extent = 2;
  const hid_t two = H5Screate_simple(1, &extent, nullptr);
  const hid_t variable = H5Tcopy(H5T_C_S1);
  H5Tset_size(variable, H5T_VARIABLE);
  const double numbers[2] = {1, 2};
  const char* text = "words";
  const int whole = 3;
  attach("whole", H5T_NATIVE_INT, one, &whole);
  attach("pair", H5T_NATIVE_DOUBLE, two, numbers);
  attach("variable", variable, one, &text);
  H5Tclose(variable);
  H5Sclose(two);
  H5Sclose(one);
  EXPECT_EQ(read_attributes(path(), "info"), (Attributes{{"whole", 3.0}}));
}

TEST_F(Attached, AValueTakesThePlaceOfOneOfAnotherType) {
  write_attributes(path(), "info", {{"a", 1.0}, {"b", "text"}});
  write_attributes(path(), "info", {{"a", "now a text"}, {"c", 2.0}});
  EXPECT_EQ(read_attributes(path(), "info"),
            (Attributes{{"a", "now a text"}, {"b", "text"}, {"c", 2.0}}));
}

TEST_F(Attached, WhatFailsLeavesTheFileAsItWas) {
  const std::string before = bytes();
  EXPECT_EQ(message_of([&] { write_attributes(path(), "info", {{"", 1.0}}); }),
            path() + ": /fclib_local/info, attribute : cannot be created");
  EXPECT_EQ(message_of([&] { write_attributes(path(), "solution", {{"a", 1.0}}); }),
            path() + ": /solution: the group is missing");
  EXPECT_EQ(bytes(), before);
  EXPECT_EQ(files(), 1U);
}

TEST_F(Attached, AFileThatCannotTakeItsNameLeavesNothing) {
  // the name of the file fits, that of the one beside it does not: a new file needs none
  const std::string longest = path(std::string(255, 'x'));
  const LocalProblem problem = no_contacts();
  write_file(longest, &problem);
  EXPECT_EQ(files(), 2U);
  const std::string too_long = longest + "x";
  for (const std::string& name : {longest, too_long}) {
    EXPECT_EQ(message_of([&] { write_file(name, &problem); }),
              name + ": cannot be written: File name too long");
    EXPECT_EQ(files(), 2U);
  }
}

}  // namespace
}  // namespace fclib
