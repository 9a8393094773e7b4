// write_seeds FOLDER: the seeds of each target, in a folder of its name.
#include <iostream>

#include "fuzz.hpp"

int main(int count, char** arguments) {
  if (count != 2) {
    std::cerr << "usage: write_seeds FOLDER\n";
    return 1;
  }
  for (const auto* target : fclib::fuzz::targets) {
    const auto folder = std::filesystem::path(arguments[1]) / target->name;
    std::filesystem::create_directories(folder);
    for (const auto& seed : target->seeds()) {
      fclib::fuzz::put_file((folder / seed.name).string(), seed.bytes);
    }
  }
}
