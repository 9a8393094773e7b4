// A folder for the files of one test.
#pragma once

#include <filesystem>
#include <random>
#include <string>

namespace fclib::testing {

/// A new empty folder, removed at the end. Its name is drawn: tests run side by side.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::random_device draw;
    do {
      path_ = std::filesystem::temp_directory_path() / ("fclib-" + std::to_string(draw()));
    } while (!std::filesystem::create_directory(path_));
  }
  ~TemporaryFolder() {
    std::error_code error;
    std::filesystem::remove_all(path_, error);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace fclib::testing
