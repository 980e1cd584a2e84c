#include "server/jobs/worker_landlock.h"

#include <fcntl.h>
#include <linux/landlock.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <system_error>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "core/status_macros.h"

namespace pepeseg {
namespace {

// Debian 12's header ends with Linux 6.1; the kernel tells what it knows beyond.
constexpr uint64_t kTruncate = uint64_t{1} << 14;
constexpr uint64_t kScopeAbstractSockets = 1, kScopeSignals = 2;
struct Ruleset {
  uint64_t handled_files;
  uint64_t handled_network;
  uint64_t scoped;
};

constexpr int kVersionOfRefer = 2, kVersionOfTruncate = 3, kVersionOfScopes = 6;

// Of a file; of a folder also what makes and removes entries.
constexpr uint64_t kWriteFile = LANDLOCK_ACCESS_FS_WRITE_FILE | kTruncate;
// No devices are made: that is what mknod is not allowed for, too.
constexpr uint64_t kWriteBelow =
    kWriteFile | LANDLOCK_ACCESS_FS_REMOVE_DIR | LANDLOCK_ACCESS_FS_REMOVE_FILE |
    LANDLOCK_ACCESS_FS_MAKE_DIR | LANDLOCK_ACCESS_FS_MAKE_REG | LANDLOCK_ACCESS_FS_MAKE_SOCK |
    LANDLOCK_ACCESS_FS_MAKE_FIFO | LANDLOCK_ACCESS_FS_MAKE_SYM | LANDLOCK_ACCESS_FS_REFER;
constexpr uint64_t kHandled =
    kWriteBelow | LANDLOCK_ACCESS_FS_MAKE_CHAR | LANDLOCK_ACCESS_FS_MAKE_BLOCK;

absl::Status SystemError(absl::string_view what) {
  return absl::InternalError(
      absl::StrCat("sandbox: ", what, ": ", std::generic_category().message(errno)));
}

class WriteRules {
 public:
  WriteRules() = default;
  ~WriteRules() {
    if (ruleset_ >= 0) close(ruleset_);
  }
  WriteRules(const WriteRules&) = delete;
  WriteRules& operator=(const WriteRules&) = delete;

  absl::Status Open(bool has_device) {
    const long version =
        syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION);
    if (version < kVersionOfRefer) {
      return absl::FailedPreconditionError(
          version < 0 ? "the kernel has no Landlock, or it is not enabled"
                      : "the kernel's Landlock is older than Linux 5.19's");
    }
    handled_ = kHandled;
    if (version < kVersionOfTruncate) handled_ &= ~kTruncate;
    Ruleset rules{handled_, 0, 0};
    size_t size = sizeof(rules.handled_files);
    if (version >= kVersionOfScopes) {
      // CUDA's driver may talk to its daemons through abstract sockets.
      rules.scoped = has_device ? kScopeSignals : kScopeSignals | kScopeAbstractSockets;
      size = sizeof(rules);
    }
    ruleset_ = static_cast<int>(syscall(SYS_landlock_create_ruleset, &rules, size, 0));
    return ruleset_ >= 0 ? absl::OkStatus() : SystemError("Landlock's rules");
  }

  // What is not there cannot be written either.
  absl::Status Allow(const std::filesystem::path& path) const {
    const int file = open(path.c_str(), O_PATH | O_CLOEXEC);
    if (file < 0 && errno == ENOENT) return absl::OkStatus();
    if (file < 0) return SystemError(path.string());
    const absl::Cleanup closes = [file] { close(file); };
    struct stat what {};
    if (fstat(file, &what) != 0) return SystemError(path.string());
    landlock_path_beneath_attr rule{};
    rule.allowed_access = (S_ISDIR(what.st_mode) ? kWriteBelow : kWriteFile) & handled_;
    rule.parent_fd = file;
    if (syscall(SYS_landlock_add_rule, ruleset_, LANDLOCK_RULE_PATH_BENEATH, &rule, 0) == 0) {
      return absl::OkStatus();
    }
    return SystemError(absl::StrCat("Landlock, ", path.string()));
  }

  absl::Status Enter() const {
    return syscall(SYS_landlock_restrict_self, ruleset_, 0) == 0 ? absl::OkStatus()
                                                                 : SystemError("Landlock");
  }

 private:
  int ruleset_ = -1;
  uint64_t handled_ = 0;
};

// Where CUDA keeps what it has compiled; as CUDA itself finds it.
std::filesystem::path CudaCache() {
  if (const char* path = std::getenv("CUDA_CACHE_PATH")) return path;
  const char* home = std::getenv("HOME");
  return std::filesystem::path(home != nullptr ? home : "/root") / ".nv";
}

}  // namespace

absl::Status LimitWrites(const SandboxNeeds& needs) {
  WriteRules rules;
  RETURN_IF_ERROR(rules.Open(needs.has_device));
  RETURN_IF_ERROR(rules.Allow(needs.folder));
  const char* temporary = std::getenv("TMPDIR");
  RETURN_IF_ERROR(rules.Allow(temporary != nullptr && *temporary != '\0' ? temporary : "/tmp"));
  // All of /dev would be disks and terminals too, where the service runs as root.
  for (const char* device : {"/dev/null", "/dev/zero", "/dev/full", "/dev/shm"}) {
    RETURN_IF_ERROR(rules.Allow(device));
  }
  if (needs.has_device) {
    std::error_code error;
    for (std::filesystem::directory_iterator entry("/dev", error), end; !error && entry != end;
         entry.increment(error)) {
      const std::string name = entry->path().filename().string();
      if (name.starts_with("nvidia")) RETURN_IF_ERROR(rules.Allow(entry->path()));
    }
    // CUDA's driver names its threads, and gives up where it cannot (seen on an H200).
    RETURN_IF_ERROR(rules.Allow("/proc/self/task"));
    std::filesystem::create_directories(CudaCache(), error);  // without it CUDA compiles each time
    RETURN_IF_ERROR(rules.Allow(CudaCache()));
  }
  return rules.Enter();
}

}  // namespace pepeseg
