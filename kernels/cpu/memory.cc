// How much memory the machine has for this process, and how much a render takes of it.
#include <malloc.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <limits>
#include <string>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/scratch_bytes.h"

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

// Of the control group this process is in, as a container is.
DeviceMemory GroupMemory() {
  std::ifstream groups("/proc/self/cgroup");
  std::string line, folder = "/sys/fs/cgroup";
  while (std::getline(groups, line)) {
    if (line.starts_with("0::") && line != "0::/") folder += line.substr(3);
  }
  int64_t limit = NumberIn(folder + "/memory.max");
  int64_t used = NumberIn(folder + "/memory.current");
  // Pages of files that nobody reads count as used, and are given up when they are asked for.
  int64_t cached = NumberOf(folder + "/memory.stat", "inactive_file");
  if (limit < 0) {  // version 1
    const std::string old = "/sys/fs/cgroup/memory";
    limit = NumberIn(old + "/memory.limit_in_bytes");
    used = NumberIn(old + "/memory.usage_in_bytes");
    cached = NumberOf(old + "/memory.stat", "total_inactive_file");
  }
  if (limit < 0 || used < 0) return {kUnlimited, kUnlimited};
  return {std::max<int64_t>(0, limit - used + std::max<int64_t>(0, cached)), limit};
}

}  // namespace

DeviceMemory CpuBackend::memory() const {
  constexpr int64_t kKib = 1024;
  DeviceMemory memory = GroupMemory();
  const int64_t available = NumberOf("/proc/meminfo", "MemAvailable:");
  const int64_t total = NumberOf("/proc/meminfo", "MemTotal:");
  if (available >= 0) memory.free_bytes = std::min(memory.free_bytes, available * kKib);
  if (total >= 0) memory.total_bytes = std::min(memory.total_bytes, total * kKib);
  memory.is_host = true;
  return memory;
}

void CpuBackend::ReleaseFreed() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

int64_t CpuBackend::ScratchBytes(const ScratchSize& size) const {
  const RenderScratch s;
  const int64_t by_gaussian =
      BytesOfRow(s.candidate_gaussian, s.candidate_splat, s.candidate_num_tiles,
                 s.candidate_num_runs, s.visible_gaussian, s.visible_splat, s.visible_first_slot,
                 s.visible_first_run, s.sort_keys, s.sort_keys) +
      (size.for_backward ? BytesOfRow(s.visible_grad) : 0);
  // A run is one entry or more.
  const int64_t by_entry = BytesOfRow(s.entry_visible, s.entry_slot, s.runs) +
                           (size.for_backward ? BytesOfRow(s.slot_grad) : 0);
  const int64_t by_tile = BytesOfRow(s.tile_first_entry);
  const int64_t by_pixel = BytesOfRow(s.pixel_transmittance, s.pixel_last_entry);
  constexpr int64_t kFixed = 4096;
  return WithReserve(by_gaussian * size.num_gaussians + by_entry * size.num_entries +
                     by_tile * size.num_tiles + by_pixel * size.num_pixels) +
         kFixed;
}

}  // namespace pepeseg
