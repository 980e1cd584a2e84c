#include "server/worker/sandbox/worker_landlock.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <link.h>
#include <linux/landlock.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <system_error>
#include <vector>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/status_macros.h"
#include "server/worker_protocol/job_isolation.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

// Missing in Debian 12's header, which is of Linux 6.1. The kernel reports whether it has them.
constexpr uint64_t kTruncate = uint64_t{1} << 14;
constexpr uint64_t kScopeAbstractSockets = 1, kScopeSignals = 2;
struct Ruleset {
  uint64_t handled_files;
  uint64_t handled_network;
  uint64_t scoped;
};

constexpr uint64_t kRead = LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_READ_DIR;
constexpr uint64_t kExecute = kRead | LANDLOCK_ACCESS_FS_EXECUTE;
constexpr uint64_t kWrite = LANDLOCK_ACCESS_FS_WRITE_FILE | kTruncate;
constexpr uint64_t kReadAndWrite = kRead | kWrite;
// Access to a folder in which regular files and folders can be made, and nothing else.
constexpr uint64_t kFill = kReadAndWrite | LANDLOCK_ACCESS_FS_REMOVE_DIR |
                           LANDLOCK_ACCESS_FS_REMOVE_FILE | LANDLOCK_ACCESS_FS_MAKE_DIR |
                           LANDLOCK_ACCESS_FS_MAKE_REG | LANDLOCK_ACCESS_FS_REFER;
// All accesses that are refused unless a rule allows them.
constexpr uint64_t kHandled = kFill | kExecute | LANDLOCK_ACCESS_FS_MAKE_CHAR |
                              LANDLOCK_ACCESS_FS_MAKE_BLOCK | LANDLOCK_ACCESS_FS_MAKE_SOCK |
                              LANDLOCK_ACCESS_FS_MAKE_FIFO | LANDLOCK_ACCESS_FS_MAKE_SYM;
// Accesses that a rule for a file may have; the others are for folders.
constexpr uint64_t kForFiles = LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_EXECUTE | kWrite;

// Programs, libraries and their data.
constexpr const char* kSystemFolders[] = {"/usr",    "/lib", "/lib32", "/lib64",
                                          "/libx32", "/bin", "/sbin"};
// What the dynamic loader and the C library read, and files about the machine.
constexpr const char* kSystemFiles[] = {"/etc/ld.so.cache",
                                        "/etc/ld.so.conf",
                                        "/etc/ld.so.conf.d",
                                        "/etc/ld.so.preload",
                                        "/etc/localtime",
                                        "/etc/timezone",
                                        "/etc/ssl/openssl.cnf",
                                        "/proc/cpuinfo",
                                        "/proc/filesystems",
                                        "/proc/meminfo",
                                        "/proc/stat",
                                        "/proc/sys/vm/overcommit_memory",
                                        "/proc/version",
                                        "/sys/devices/system/cpu",
                                        "/sys/devices/system/node",
                                        "/sys/fs/cgroup",
                                        "/sys/kernel/mm/transparent_hugepage"};
// Files in which Python and other programs look up the user's name.
constexpr const char* kProgramFiles[] = {"/etc/passwd", "/etc/group", "/etc/nsswitch.conf"};
constexpr const char* kDeviceFiles[] = {"/sys", "/proc/devices", "/proc/modules",
                                        "/proc/driver/nvidia", "/etc/nvidia"};
constexpr const char* kReadDevices[] = {"/dev/random", "/dev/urandom"};
// Not all of /dev: it has disks and terminals, which a service that runs as root could open.
constexpr const char* kWriteDevices[] = {"/dev/null", "/dev/zero", "/dev/full"};

absl::Status SystemError(absl::string_view what) {
  return absl::InternalError(
      absl::StrCat("sandbox: ", what, ": ", std::generic_category().message(errno)));
}

// A Landlock ruleset. Open, allow paths, then enter.
class FileRules {
 public:
  FileRules() = default;
  ~FileRules() {
    if (ruleset_ >= 0) close(ruleset_);
  }
  FileRules(const FileRules&) = delete;
  FileRules& operator=(const FileRules&) = delete;

  // Creates the ruleset with what the kernel's version supports. FAILED_PRECONDITION: too old.
  absl::Status Open() {
    const int version = LandlockVersion();
    if (version < kLandlockRefer) {
      return absl::FailedPreconditionError(MissingFromSandbox(version));
    }
    handled_ = kHandled;
    if (version < kLandlockTruncate) handled_ &= ~kTruncate;
    Ruleset rules{handled_, 0, 0};
    size_t size = sizeof(rules.handled_files);
    if (version >= kLandlockScopes) {
      rules.scoped = kScopeSignals | kScopeAbstractSockets;
      size = sizeof(rules);
    }
    ruleset_ = static_cast<int>(syscall(SYS_landlock_create_ruleset, &rules, size, 0));
    return ruleset_ >= 0 ? absl::OkStatus() : SystemError("Landlock's rules");
  }

  // Allows `access` below a folder, or as much of it as applies to a file. Skips a path that this
  // process cannot find or reach.
  absl::Status Allow(const fs::path& path, uint64_t access) const {
    const int file = open(path.c_str(), O_PATH | O_CLOEXEC);
    if (file < 0 && (errno == ENOENT || errno == ENOTDIR || errno == EACCES)) {
      return absl::OkStatus();
    }
    if (file < 0) return SystemError(path.string());
    const absl::Cleanup closes = [file] { close(file); };
    struct stat what {};
    if (fstat(file, &what) != 0) return SystemError(path.string());
    landlock_path_beneath_attr rule{};
    // The kernel refuses a rule with accesses that the ruleset does not handle, or that a file
    // cannot have.
    rule.allowed_access = access & handled_ & (S_ISDIR(what.st_mode) ? ~uint64_t{0} : kForFiles);
    rule.parent_fd = file;
    if (syscall(SYS_landlock_add_rule, ruleset_, LANDLOCK_RULE_PATH_BENEATH, &rule, 0) == 0) {
      return absl::OkStatus();
    }
    return SystemError(absl::StrCat("Landlock, ", path.string()));
  }

  template <typename Paths>
  absl::Status AllowEach(const Paths& paths, uint64_t access) const {
    for (const auto& path : paths) RETURN_IF_ERROR(Allow(path, access));
    return absl::OkStatus();
  }

  absl::Status Enter() const {
    return syscall(SYS_landlock_restrict_self, ruleset_, 0) == 0 ? absl::OkStatus()
                                                                 : SystemError("Landlock");
  }

 private:
  int ruleset_ = -1;
  uint64_t handled_ = 0;
};

// Returns the folder in which CUDA keeps compiled kernels.
fs::path CudaCache() {
  if (const char* path = std::getenv("CUDA_CACHE_PATH")) return path;
  const char* home = std::getenv("HOME");
  return fs::path(home != nullptr ? home : "/root") / ".nv";
}

// Returns the paths of the libraries that this process has loaded.
std::vector<fs::path> LoadedLibraries() {
  std::vector<fs::path> libraries;
  dl_iterate_phdr(
      [](dl_phdr_info* info, size_t, void* found) {
        const std::string name = info->dlpi_name;
        if (name.starts_with('/')) static_cast<std::vector<fs::path>*>(found)->emplace_back(name);
        return 0;
      },
      &libraries);
  return libraries;
}

// Returns the folders of LD_LIBRARY_PATH, without relative ones.
std::vector<fs::path> LibraryFolders() {
  std::vector<fs::path> folders;
  const char* words = std::getenv("LD_LIBRARY_PATH");
  for (const absl::string_view word : absl::StrSplit(words != nullptr ? words : "", ':')) {
    if (!word.empty() && word.front() == '/') folders.emplace_back(std::string(word));
  }
  return folders;
}

// Returns the folders of CUDA's driver, which loads more libraries from there.
std::vector<fs::path> CudaFolders() {
  // Loaded here, before the rules are in force, so that its path is known. The handle is kept.
  dlopen("libcuda.so.1", RTLD_LAZY | RTLD_GLOBAL);
  std::vector<fs::path> folders;
  for (const fs::path& library : LoadedLibraries()) {
    if (!library.filename().string().starts_with("libcuda.so")) continue;
    folders.push_back(library.parent_path());
    std::error_code error;
    const fs::path real = fs::canonical(library, error);
    if (!error) folders.push_back(real.parent_path());
  }
  return folders;
}

absl::Status AllowSystem(const FileRules& rules, bool runs_programs) {
  RETURN_IF_ERROR(rules.AllowEach(kSystemFolders, runs_programs ? kExecute : kRead));
  RETURN_IF_ERROR(rules.AllowEach(kSystemFiles, kRead));
  RETURN_IF_ERROR(rules.AllowEach(kReadDevices, kRead));
  RETURN_IF_ERROR(rules.AllowEach(kWriteDevices, kReadAndWrite));
  RETURN_IF_ERROR(rules.AllowEach(LoadedLibraries(), kRead));
  RETURN_IF_ERROR(rules.AllowEach(LibraryFolders(), kRead));
  RETURN_IF_ERROR(rules.Allow("/proc/self/exe", kRead));
  // The rule is for this process's folder. Programs that it starts cannot read their own.
  return rules.Allow("/proc/self", kRead);
}

absl::Status AllowDevice(const FileRules& rules) {
  RETURN_IF_ERROR(rules.AllowEach(CudaFolders(), kRead));
  RETURN_IF_ERROR(rules.AllowEach(kDeviceFiles, kRead));
  std::error_code error;
  for (fs::directory_iterator entry("/dev", error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.starts_with("nvidia")) RETURN_IF_ERROR(rules.Allow(entry->path(), kReadAndWrite));
  }
  // CUDA's driver writes the names of its threads, and fails where it cannot (seen on an H200).
  RETURN_IF_ERROR(rules.Allow("/proc/self/task", kReadAndWrite));
  fs::create_directories(CudaCache(), error);  // without it CUDA compiles each time
  return rules.Allow(CudaCache(), kFill);
}

}  // namespace

absl::Status LimitFiles(const SandboxNeeds& needs) {
  FileRules rules;
  RETURN_IF_ERROR(rules.Open());
  RETURN_IF_ERROR(AllowSystem(rules, needs.runs_programs));
  RETURN_IF_ERROR(rules.AllowEach(needs.reads, kRead));
  RETURN_IF_ERROR(rules.AllowEach(needs.writes, kFill));
  if (needs.runs_programs) {
    RETURN_IF_ERROR(rules.AllowEach(needs.programs, kExecute));
    RETURN_IF_ERROR(rules.AllowEach(kProgramFiles, kRead));
  }
  // Semaphores and shared memory of Python's processes. CUDA does not need it (seen on an H100).
  if (needs.runs_programs) RETURN_IF_ERROR(rules.Allow("/dev/shm", kFill));
  if (needs.has_device) RETURN_IF_ERROR(AllowDevice(rules));
  return rules.Enter();
}

}  // namespace pepeseg
