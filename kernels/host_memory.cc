#include "kernels/host_memory.h"

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <limits>

namespace pepeseg {
namespace {

constexpr int64_t kUnlimited = std::numeric_limits<int64_t>::max();

// The number behind a word in a file of lines of "word number"; -1: there is none.
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

// The number that a file holds; -1: none ("max", or no such file).
int64_t NumberIn(const std::string& path) {
  std::ifstream file(path);
  int64_t number = -1;
  return file >> number ? number : -1;
}

// Where a version of control groups is mounted, and what it calls its numbers.
struct GroupFiles {
  std::string mount;
  const char* limit;
  const char* used;
  const char* cached;  // a word in memory.stat
};

DeviceMemory MemoryOfGroup(const std::string& folder, const GroupFiles& files) {
  const int64_t limit = NumberIn(folder + "/" + files.limit);
  const int64_t used = NumberIn(folder + "/" + files.used);
  if (limit < 0 || used < 0) return {kUnlimited, kUnlimited};
  // Pages of files that nobody reads count as used, and are given up when they are asked for.
  const int64_t cached = std::max<int64_t>(0, NumberOf(folder + "/memory.stat", files.cached));
  return {std::max<int64_t>(0, limit - used + cached), limit};
}

// The least of a group's and of all above it. In a container its own path may be the host's, which
// is not mounted: then the mount's root is the container's group.
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

// A line "NUMBER:CONTROLLERS:/GROUP" of /proc/self/cgroup.
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
