#include "server/jobs/holder_name.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace pepeseg {
namespace {

// Returns an id of the processes that see each other's process ids: machine and process namespace.
// Empty: unknown.
std::string ProcessSpace() {
  std::string boot;
  std::ifstream("/proc/sys/kernel/random/boot_id") >> boot;
  std::error_code error;
  const auto names = std::filesystem::read_symlink("/proc/self/ns/pid", error);  // "pid:[4026..]"
  if (boot.empty() || error) return "";
  return absl::StrCat(boot, "/", names.string());
}

// Returns the start time of a process in clock ticks since boot. Empty: there is no such process.
std::string StartTime(int64_t pid) {
  std::ifstream file(absl::StrCat("/proc/", pid, "/stat"));
  std::string text;
  std::getline(file, text);
  const size_t name_end = text.rfind(')');  // the name may have spaces and parentheses, too
  if (name_end == std::string::npos) return "";
  constexpr size_t kStartTime = 20;  // number of the field among those after the name, from 1
  const std::vector<std::string> fields =
      absl::StrSplit(text.substr(name_end + 1), ' ', absl::SkipEmpty());
  return fields.size() < kStartTime ? "" : fields[kStartTime - 1];
}

}  // namespace

std::string HolderName() {
  const int64_t pid = getpid();
  // The start time distinguishes the process from a later one with the same id.
  return absl::StrCat(ProcessSpace(), "/", pid, "/", StartTime(pid));
}

bool IsKnownGone(const std::string& holder) {
  const std::string space = ProcessSpace();
  // A process of another machine, or of another container, cannot be seen from here. After a reboot
  // the boot id differs: then the lease must expire.
  if (space.empty() || !holder.starts_with(space + "/")) return false;
  const std::vector<std::string> parts = absl::StrSplit(holder.substr(space.size() + 1), '/');
  int64_t pid = 0;
  if (parts.size() != 2 || !absl::SimpleAtoi(parts[0], &pid)) return false;
  return StartTime(pid) != parts[1];
}

}  // namespace pepeseg
