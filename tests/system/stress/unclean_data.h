#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace pepeseg {

// What is wrong with a data directory, kept with SQLite, that no server uses, when each life in it
// is done.
std::vector<std::string> FindUnclean(const std::filesystem::path& data);

}  // namespace pepeseg
