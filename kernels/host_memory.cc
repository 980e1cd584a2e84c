#include "kernels/host_memory.h"

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <limits>

namespace pepeseg {
namespace {

constexpr int64_t kUnlimited = std::numeric_limits<int64_t>::max();

// Returns the number after `word` in a file with lines "WORD NUMBER ...", or -1 if there is none.
int64_t NumberOf(const std::string& path, const std::string& word) {
  std::ifstream file(path);
  std::string found;
  int64_t number = -1;
  while (file >> found) {
    if (found == word && file >> number) return number;
    file.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
  }
  return -1;
}

// Returns the number in a file, or -1 if it holds none ("max") or does not exist.
int64_t NumberIn(const std::string& path) {
  std::ifstream file(path);
  int64_t number = -1;
  return file >> number ? number : -1;
}

// The files of one version of control groups.
struct GroupFiles {
  std::string mount;
  const char* limit;
  const char* used;
  const char* cached;  // the word in memory.stat for pages that can be reclaimed
};

// Limit and free memory of one group; unlimited if it has no limit or cannot be read.
DeviceMemory MemoryOfGroup(const std::string& folder, const GroupFiles& files) {
  const int64_t limit = NumberIn(folder + "/" + files.limit);
  const int64_t used = NumberIn(folder + "/" + files.used);
  if (limit < 0 || used < 0) return {kUnlimited, kUnlimited};
  // Inactive pages of the file cache count as used, but the kernel reclaims them on demand.
  const int64_t cached = std::max<int64_t>(0, NumberOf(folder + "/memory.stat", files.cached));
  return {std::max<int64_t>(0, limit - used + cached), limit};
}

// Returns the least of a group's memory and of all groups above it. In a container the path may be
// the host's, which is not mounted there; then the root of the mount is the container's group.
DeviceMemory MemoryOfGroups(std::string group, const GroupFiles& files) {
  DeviceMemory least{kUnlimited, kUnlimited};
  while (true) {
    const DeviceMemory found = MemoryOfGroup(files.mount + group, files);
    least.free_bytes = std::min(least.free_bytes, found.free_bytes);
    least.total_bytes = std::min(least.total_bytes, found.total_bytes);
    if (group.empty()) return least;
    group.resize(group.rfind('/') == std::string::npos ? 0 : group.rfind('/'));
  }
}

// A line "NUMBER:CONTROLLERS:/GROUP" of /proc/self/cgroup. Version 2 has one line, "0::/GROUP".
struct GroupLine {
  explicit GroupLine(const std::string& line) {
    const size_t first = line.find(':'), second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) return;
    const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
    is_second_version = line.starts_with("0::");
    is_of_memory = is_second_version || controllers.find(",memory,") != std::string::npos;
    group = line.substr(second + 1);
    if (group == "/") group.clear();
  }
  bool is_second_version = false, is_of_memory = false;
  std::string group;  // empty: the root
};

// Returns the least memory of the groups of this process, over both versions.
DeviceMemory GroupMemory(const std::string& root) {
  const GroupFiles second{root + "/sys/fs/cgroup", "memory.max", "memory.current", "inactive_file"};
  const GroupFiles first{root + "/sys/fs/cgroup/memory", "memory.limit_in_bytes",
                         "memory.usage_in_bytes", "total_inactive_file"};
  DeviceMemory least{kUnlimited, kUnlimited};
  std::ifstream groups(root + "/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    const GroupLine parts(line);
    if (!parts.is_of_memory) continue;
    const DeviceMemory found =
        MemoryOfGroups(parts.group, parts.is_second_version ? second : first);
    least.free_bytes = std::min(least.free_bytes, found.free_bytes);
    least.total_bytes = std::min(least.total_bytes, found.total_bytes);
  }
  return least;
}

}  // namespace

DeviceMemory HostMemory(const std::string& root) {
  constexpr int64_t kKib = 1024;
  DeviceMemory memory = GroupMemory(root);
  const int64_t available = NumberOf(root + "/proc/meminfo", "MemAvailable:");
  const int64_t total = NumberOf(root + "/proc/meminfo", "MemTotal:");
  if (available >= 0) memory.free_bytes = std::min(memory.free_bytes, available * kKib);
  if (total >= 0) memory.total_bytes = std::min(memory.total_bytes, total * kKib);
  memory.is_host = true;
  return memory;
}

}  // namespace pepeseg
