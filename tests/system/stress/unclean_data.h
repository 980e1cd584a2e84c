#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace pepeseg {

// Returns what is wrong with a data directory with SQLite that no server uses, after all scene
// lives in it have ended.
std::vector<std::string> FindUnclean(const std::filesystem::path& data);

}  // namespace pepeseg
