// What code in a file that a worker decodes could try. Each attempt runs in its own process, which
// has entered the sandbox.
#include "server/worker/sandbox/worker_sandbox.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/fs.h>
#include <netinet/in.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <sys/xattr.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <iostream>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "server/worker/sandbox/worker_limits.h"
#include "server/worker_protocol/heartbeat.h"
#include "server/worker_protocol/job_isolation.h"
#include "tests/server/worker/sandbox/listening_socket.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

constexpr int kNotEntered = 255;
constexpr long kFchmodat2 = 452;  // newer than the headers of Debian 12

// Returns 0 if the call succeeded, else its errno.
int ErrorOf(long result) { return result >= 0 ? 0 : errno; }

bool HasLandlock() { return LandlockVersion() >= kLandlockRefer; }

class WorkerSandboxTest : public ::testing::Test {
 protected:
  WorkerSandboxTest() {
    needs_.writes = {folder_ / "job"};
    needs_.reads = {folder_ / "blobs/mine"};
    for (const char* folder : {"job", "blobs"}) {
      std::filesystem::create_directories(folder_ / folder);
    }
    for (const char* file : {"blobs/mine", "blobs/theirs", "pepeseg.db", "audit.log", "job/old"}) {
      std::ofstream(folder_ / file) << file;
    }
  }

  // Runs `act` in a process that has entered the sandbox, and returns the process's status as
  // waitpid reports it.
  int Try(const std::function<int()>& act) {
    const pid_t pid = fork();
    if (pid == 0) {
      const absl::Status entered = EnterSandbox(needs_);
      if (!entered.ok()) std::cerr << entered << std::endl;
      _exit(entered.ok() ? act() : kNotEntered);
    }
    int status = 0;
    EXPECT_EQ(waitpid(pid, &status, 0), pid);
    return status;
  }
  void ExpectRefused(const std::function<long()>& call, int error = EPERM) {
    const int status = Try([&] { return ErrorOf(call()); });
    EXPECT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
    EXPECT_EQ(WEXITSTATUS(status), error);
  }
  // Makes all calls in one process.
  void ExpectEachRefused(const std::vector<std::function<long()>>& calls) {
    const int status = Try([&] {
      for (size_t i = 0; i < calls.size(); ++i) {
        if (ErrorOf(calls[i]()) != EPERM) return static_cast<int>(i) + 1;
      }
      return 0;
    });
    EXPECT_EQ(status, 0) << "call " << WEXITSTATUS(status) << " of the list is not refused";
  }
  void ExpectAllowed(const std::function<long()>& call) { ExpectRefused(call, 0); }
  void ExpectKilled(const std::function<long()>& call) {
    const int status = Try([&] { return ErrorOf(call()); });
    EXPECT_TRUE(WIFSIGNALED(status)) << "exit code " << WEXITSTATUS(status);
    EXPECT_EQ(WTERMSIG(status), SIGSYS);
  }
  long Open(const std::string& name, int flags) const {
    return OpenPath((folder_ / name).string(), flags);
  }
  static long OpenPath(const std::string& path, int flags) {
    return open(path.c_str(), flags | O_CLOEXEC, 0600);
  }
  // Runs `test` for each kind of job.
  void ForEachKind(const std::function<void()>& test) {
    for (const bool programs : {false, true}) {
      for (const bool device : {false, true}) {
        SCOPED_TRACE(absl::StrCat("programs ", programs, ", device ", device));
        needs_.runs_programs = programs;
        needs_.has_device = device;
        test();
      }
    }
  }
  long Exec() const {
    const pid_t pid = fork();
    if (pid < 0) return -1;
    if (pid == 0) {
      execl("/bin/true", "true", nullptr);
      _exit(errno);
    }
    int status = 0;
    waitpid(pid, &status, 0);
    errno = WEXITSTATUS(status);
    return WIFEXITED(status) && errno == 0 ? 0 : -1;
  }

  testing::TempFolder folder_;
  SandboxNeeds needs_;
};

long ConnectToPort(uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(port);
  const int end = socket(AF_INET, SOCK_STREAM, 0);
  if (end < 0) return -1;
  return connect(end, reinterpret_cast<sockaddr*>(&address), sizeof(address));
}

long ConnectToPath(const std::filesystem::path& path, int end) {
  if (end < 0) return -1;
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.string().copy(address.sun_path, sizeof(address.sun_path) - 1);
  return connect(end, reinterpret_cast<const sockaddr*>(&address), sizeof(address));
}

TEST_F(WorkerSandboxTest, HasNoNetwork) {
  const testing::ListeningSocket server;
  ASSERT_EQ(ConnectToPort(server.port()), 0);
  ForEachKind([&] {
    ExpectRefused([&] { return ConnectToPort(server.port()); });
    for (const int family : {AF_INET, AF_INET6, AF_NETLINK, AF_PACKET, AF_VSOCK}) {
      ExpectRefused([&] { return socket(family, SOCK_DGRAM, 0); });
    }
    ExpectRefused([] { return syscall(SYS_io_uring_setup, 8, nullptr); });
  });
}

// That includes the admin listener's.
TEST_F(WorkerSandboxTest, ReachesNoLocalSocket) {
  const std::filesystem::path path = folder_ / "job/admin";
  const testing::ListeningSocket server(path);
  ASSERT_EQ(ConnectToPath(path, socket(AF_UNIX, SOCK_STREAM, 0)), 0);
  const int made_before = socket(AF_UNIX, SOCK_STREAM, 0);
  ForEachKind([&] {
    ExpectRefused([&] { return ConnectToPath(path, socket(AF_UNIX, SOCK_STREAM, 0)); });
    ExpectRefused([&] { return ConnectToPath(path, made_before); });
  });
  close(made_before);
}

// A datagram socket could send to any name without connecting.
TEST_F(WorkerSandboxTest, MakesPairsOfConnectedSocketsOnly) {
  int ends[2];
  ForEachKind([&] {
    ExpectAllowed([&] { return socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends); });
    ExpectAllowed([&] { return socketpair(AF_UNIX, SOCK_SEQPACKET, 0, ends); });
    ExpectRefused([&] { return socketpair(AF_UNIX, SOCK_DGRAM, 0, ends); });
    ExpectRefused([] { return socket(AF_UNIX, SOCK_DGRAM, 0); });
  });
}

// CUDA's driver listens on an abstract socket, and fails where it cannot.
TEST_F(WorkerSandboxTest, ListensLocallyOnlyForCuda) {
  const auto listens = [] {
    const int end = socket(AF_UNIX, SOCK_SEQPACKET, 0);
    if (end < 0) return -1;
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    absl::SNPrintF(address.sun_path + 1, sizeof(address.sun_path) - 1, "pepeseg-test-%d", getpid());
    if (bind(end, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) return -1;
    return listen(end, 1);
  };
  needs_.runs_programs = true;
  ExpectRefused(listens);
  needs_.has_device = true;
  ExpectAllowed(listens);
  ExpectRefused([] { return socket(AF_UNIX, SOCK_STREAM, 0); });
}

TEST_F(WorkerSandboxTest, RunsProgramsOnlyIfTheJobNeedsThem) {
  ExpectRefused([] { return execl("/bin/true", "true", nullptr); });
  if (!kSanitized) ExpectRefused([] { return fork(); });
  needs_.has_device = true;
  ExpectRefused([] { return execl("/bin/true", "true", nullptr); });
  needs_.runs_programs = true;
  ExpectAllowed([this] { return Exec(); });
}

// A program that the worker starts has the filter, too.
TEST_F(WorkerSandboxTest, IsInheritedByPrograms) {
  needs_.runs_programs = true;
  const std::string script =
      "import socket,sys\ntry:\n  socket.socket()\nexcept PermissionError:\n"
      "  sys.exit(7)\n";
  const int status =
      Try([&] { return execl("/usr/bin/python3", "python3", "-c", script.c_str(), nullptr); });
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 7);
}

TEST_F(WorkerSandboxTest, ReadsOnlyTheFilesOfItsJob) {
  if (!HasLandlock()) GTEST_SKIP() << "the kernel has no Landlock";
  ForEachKind([&] {
    ExpectAllowed([this] { return Open("blobs/mine", O_RDONLY); });
    ExpectAllowed([this] { return Open("job/old", O_RDONLY); });
    for (const char* name : {"blobs/theirs", "pepeseg.db", "audit.log"}) {
      ExpectRefused([&] { return Open(name, O_RDONLY); }, EACCES);
    }
    for (const char* folder : {"blobs", "."}) {
      ExpectRefused([&] { return Open(folder, O_RDONLY | O_DIRECTORY); }, EACCES);
    }
    const std::string parent = absl::StrCat("/proc/", getppid());
    const std::string test = absl::StrCat("/proc/", getpid());
    for (const std::string& process : {parent, test}) {
      for (const char* file : {"/environ", "/cmdline", "/maps", "/mem"}) {
        ExpectRefused([&] { return OpenPath(process + file, O_RDONLY); }, EACCES);
      }
    }
    for (const char* path : {"/etc/shadow", "/root", "/home", "/var", "/tmp", "/", "/proc"}) {
      ExpectRefused([&] { return OpenPath(path, O_RDONLY); }, EACCES);
    }
  });
}

TEST_F(WorkerSandboxTest, ReadsWhatLibrariesNeed) {
  ForEachKind([&] {
    for (const char* path : {"/usr/lib", "/etc/ld.so.cache", "/dev/urandom", "/proc/self/status",
                             "/proc/meminfo", "/sys/devices/system/cpu/online"}) {
      ExpectAllowed([&] { return OpenPath(path, O_RDONLY); });
    }
  });
}

TEST_F(WorkerSandboxTest, WritesOnlyBelowItsFolder) {
  if (!HasLandlock()) GTEST_SKIP() << "the kernel has no Landlock";
  ForEachKind([&] {
    for (const char* name : {"audit.log", "blobs/mine"}) {
      ExpectRefused([&] { return Open(name, O_WRONLY); }, EACCES);
      ExpectRefused([&] { return Open(name, O_RDWR | O_APPEND); }, EACCES);
    }
    ExpectRefused([this] { return Open("new", O_WRONLY | O_CREAT); }, EACCES);
    ExpectRefused([this] { return unlink((folder_ / "audit.log").c_str()); }, EACCES);
    ExpectRefused([this] { return mkdir((folder_ / "new").c_str(), 0700); }, EACCES);
    ExpectRefused(
        [this] { return rename((folder_ / "audit.log").c_str(), (folder_ / "job/a").c_str()); },
        EACCES);
    ExpectRefused([] { return OpenPath("/dev/tty", O_WRONLY); }, EACCES);
    ExpectRefused([] { return OpenPath("/etc/passwd", O_WRONLY); }, EACCES);
    ExpectRefused([] { return OpenPath("/tmp/new", O_WRONLY | O_CREAT); }, EACCES);
    ExpectAllowed([this] { return Open("job/new", O_WRONLY | O_CREAT | O_TRUNC); });
    ExpectAllowed([] { return OpenPath("/dev/null", O_RDWR); });
  });
}

// O_TRUNC truncates a file that is opened for reading, too, and Landlock of older kernels does not
// cover it.
TEST_F(WorkerSandboxTest, TruncatesNothingThatItOpensForReading) {
  ForEachKind([&] {
    for (const char* name : {"blobs/mine", "job/old"}) {
      ExpectRefused([&] { return Open(name, O_RDONLY | O_TRUNC); });
      const std::string path = folder_ / name;
      ExpectRefused([&] { return syscall(SYS_open, path.c_str(), O_RDONLY | O_TRUNC, 0); });
      const uint64_t how[3] = {O_RDONLY | O_TRUNC, 0, 0};
      ExpectRefused([&] { return syscall(SYS_openat2, AT_FDCWD, path.c_str(), how, sizeof(how)); },
                    ENOSYS);
    }
    EXPECT_EQ(std::filesystem::file_size(folder_ / "blobs/mine"), 10u);
  });
}

// Landlock has no right for these calls: files of the server's user could be made unreadable, and
// secrets readable.
TEST_F(WorkerSandboxTest, ChangesNoFileWithoutOpeningItForWriting) {
  const int folder = open(folder_.path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const int mine = open((folder_ / "blobs/mine").c_str(), O_RDONLY | O_CLOEXEC);
  std::vector<std::function<long()>> calls = {
      [=] { return fchown(mine, getuid(), getgid()); },
      [=] { return syscall(SYS_utimensat, mine, nullptr, nullptr, 0); },
      [=] { return fsetxattr(mine, "user.a", "b", 1, 0); },
      [=] { return fremovexattr(mine, "user.a"); },
      [=, flags = 0] { return syscall(SYS_ioctl, mine, FS_IOC_SETFLAGS, &flags); },
      [=, to = fsxattr{}] { return syscall(SYS_ioctl, mine, FS_IOC_FSSETXATTR, &to); },
  };
  for (const char* name : {"pepeseg.db", "blobs/mine", "job/old"}) {
    const std::string path = folder_ / name;
    calls.insert(calls.end(), {[=] { return chmod(path.c_str(), 0); },
                               [=] { return syscall(SYS_fchmodat, folder, name, 0); },
                               [=] { return syscall(kFchmodat2, folder, name, 0, 0); },
                               [=] { return chown(path.c_str(), getuid(), getgid()); },
                               [=] { return lchown(path.c_str(), getuid(), getgid()); },
                               [=] { return fchownat(folder, name, getuid(), getgid(), 0); },
                               [=] { return syscall(SYS_utime, path.c_str(), nullptr); },
                               [=] { return syscall(SYS_utimes, path.c_str(), nullptr); },
                               [=] { return syscall(SYS_futimesat, folder, name, nullptr); },
                               [=] { return syscall(SYS_utimensat, folder, name, nullptr, 0); },
                               [=] { return setxattr(path.c_str(), "user.a", "b", 1, 0); },
                               [=] { return lsetxattr(path.c_str(), "user.a", "b", 1, 0); },
                               [=] { return removexattr(path.c_str(), "user.a"); },
                               [=] { return lremovexattr(path.c_str(), "user.a"); },
                               [=] { return truncate(path.c_str(), 0); }});
  }
  ForEachKind([&] {
    ExpectEachRefused(calls);
    ExpectAllowed([=] { return fchmod(mine, 0); });  // answered, and not done
  });
  close(folder);
  close(mine);
  const auto mode = std::filesystem::status(folder_ / "blobs/mine").permissions();
  EXPECT_NE(mode & std::filesystem::perms::owner_read, std::filesystem::perms::none);
}

// A worker that cannot is taken for stuck, and killed after 30 seconds.
TEST_F(WorkerSandboxTest, TouchesItsHeartbeat) {
  const std::filesystem::path heartbeat = folder_ / "job/heartbeat";
  const auto before = std::filesystem::file_time_type::clock::now() - std::chrono::hours(1);
  ForEachKind([&] {
    for (const bool there : {false, true}) {
      if (there) std::filesystem::last_write_time(heartbeat, before);
      ExpectAllowed([&] { return Beat(heartbeat) ? 0 : -1; });
      EXPECT_GT(std::filesystem::last_write_time(heartbeat), before);
    }
    std::filesystem::remove(heartbeat);
  });
}

// Copying a file sets its mode.
TEST_F(WorkerSandboxTest, CopiesFilesIntoItsFolder) {
  ExpectAllowed([this] {
    std::error_code error;
    std::filesystem::copy_file(folder_ / "blobs/mine", folder_ / "job/copy", error);
    errno = error.value();
    return error ? -1 : 0;
  });
}

// The server reads the job's folder with its own rights, so a link there could lead it elsewhere.
TEST_F(WorkerSandboxTest, CreatesOnlyFilesAndFolders) {
  const std::string secret = folder_ / "audit.log", mine = folder_ / "job/old";
  ForEachKind([&] {
    for (const std::string& target : {secret, mine}) {
      const std::string link = folder_ / "job/events-1.log";
      ExpectRefused([&] { return symlink(target.c_str(), link.c_str()); });
      ExpectRefused([&] { return symlinkat(target.c_str(), AT_FDCWD, link.c_str()); });
      ExpectRefused([&] { return ::link(target.c_str(), link.c_str()); });
      ExpectRefused([&] { return linkat(AT_FDCWD, target.c_str(), AT_FDCWD, link.c_str(), 0); });
    }
    ExpectRefused([&] { return mkfifo((folder_ / "job/pipe").c_str(), 0600); });
  });
}

TEST_F(WorkerSandboxTest, ExecutesNoFileThatItWrote) {
  if (!HasLandlock()) GTEST_SKIP() << "the kernel has no Landlock";
  needs_.runs_programs = true;
  std::filesystem::copy_file("/bin/true", folder_ / "job/true");
  std::filesystem::copy_file("/bin/true", folder_ / "true");
  const auto run = [this](const char* name) {
    return execl((folder_ / name).c_str(), "true", nullptr);
  };
  ExpectRefused([&] { return run("job/true"); }, EACCES);
  ExpectRefused([&] { return run("true"); }, EACCES);
  needs_.programs = {folder_ / "true"};
  ExpectAllowed([&] { return run("true"); });
}

TEST(LandlockVersions, ReportWhatOldKernelsLack) {
  EXPECT_THAT(MissingFromSandbox(0), ::testing::HasSubstr("files are not limited"));
  EXPECT_THAT(MissingFromSandbox(1), ::testing::HasSubstr("files are not limited"));
  EXPECT_THAT(MissingFromSandbox(kLandlockRefer), ::testing::HasSubstr("signals"));
  EXPECT_EQ(MissingFromSandbox(kLandlockScopes), "");
}

TEST_F(WorkerSandboxTest, GetsNoPrivilegesAndNoNamespaces) {
  for (const bool more : {false, true}) {
    needs_.runs_programs = needs_.has_device = more;
    ExpectRefused([] { return setuid(0); });
    ExpectRefused([] { return setgid(0); });
    ExpectRefused([] { return unshare(CLONE_NEWUSER); });
    ExpectRefused([] { return syscall(SYS_setns, 0, 0); });
    ExpectRefused([] { return syscall(SYS_clone, CLONE_NEWUSER | SIGCHLD, 0, 0, 0, 0); });
    ExpectRefused([] { return syscall(SYS_clone3, nullptr, 0); }, ENOSYS);
    ExpectRefused([] { return chroot("/"); });
    ExpectRefused([this] { return mknod((folder_ / "job/disk").c_str(), S_IFBLK, 0x800); });
    ExpectRefused([] { return setsid(); });
  }
}

TEST_F(WorkerSandboxTest, CannotChangeItsLimits) {
  const rlimit more{RLIM_INFINITY, RLIM_INFINITY};
  rlimit now{};
  ExpectAllowed([&] { return getrlimit(RLIMIT_DATA, &now); });
  ExpectRefused([&] { return setrlimit(RLIMIT_DATA, &more); });
  needs_.has_device = true;
  const pid_t parent = getpid();
  ExpectRefused([&] { return prlimit(parent, RLIMIT_DATA, nullptr, &now); });
}

TEST_F(WorkerSandboxTest, TakesNoPriorityOverTheServer) {
  for (const bool programs : {false, true}) {
    needs_.runs_programs = programs;
    needs_.has_device = !programs;
    const sched_param none{0};
    const sched_param high{1};
    ExpectAllowed([&] { return sched_setscheduler(0, SCHED_BATCH, &none); });
    ExpectRefused([&] { return sched_setscheduler(0, SCHED_FIFO, &high); });
    ExpectRefused([&] { return sched_setscheduler(0, SCHED_RR, &high); });
    ExpectRefused([] { return syscall(SYS_sched_setattr, 0, nullptr, 0); });
    ExpectAllowed([] { return setpriority(PRIO_PROCESS, 0, 19); });
    ExpectRefused([] { return setpriority(PRIO_PROCESS, 0, -1); });
    constexpr int kOfProcess = 1, kRealTime = 1 << 13, kIdle = 3 << 13;
    ExpectAllowed([] { return syscall(SYS_ioprio_set, kOfProcess, 0, kIdle); });
    ExpectRefused([] { return syscall(SYS_ioprio_set, kOfProcess, 0, kRealTime); });
  }
}

TEST_F(WorkerSandboxTest, CannotTypeIntoATerminal) {
  char typed = 'x';
  for (const unsigned long high : {0UL, 1UL << 32}) {
    ExpectRefused([&] { return syscall(SYS_ioctl, 0, high | TIOCSTI, &typed); });
  }
  // Every other request reaches the device.
  ExpectRefused([] { return syscall(SYS_ioctl, -1, 0xc0384601UL, nullptr); }, EBADF);
  termios settings{};
  ExpectRefused([&] { return syscall(SYS_ioctl, -1, TCGETS, &settings); }, EBADF);
}

TEST_F(WorkerSandboxTest, IsKilledByCallsOfAttacks) {
  for (const bool more : {false, true}) {
    needs_.runs_programs = needs_.has_device = more;
    if (!kSanitized) ExpectKilled([] { return ptrace(PTRACE_TRACEME, 0, nullptr, nullptr); });
    ExpectKilled([] { return mount("none", "/mnt", "tmpfs", 0, nullptr); });
    for (const long call : {SYS_process_vm_readv, SYS_process_vm_writev, SYS_kexec_load,
                            SYS_init_module, SYS_bpf, SYS_perf_event_open, SYS_userfaultfd,
                            SYS_keyctl, SYS_open_by_handle_at, SYS_pivot_root}) {
      SCOPED_TRACE(call);
      ExpectKilled([call] { return syscall(call, 0, 0, 0, 0, 0, 0); });
    }
  }
}

TEST_F(WorkerSandboxTest, ComputesInThreads) {
  ExpectAllowed([] {
    int sum = 0;
    std::thread([&sum] { sum = 3; }).join();
    return sum == 3 ? 0 : -1;
  });
}

TEST_F(WorkerSandboxTest, SignalsOnlyItself) {
  const pid_t parent = getpid();
  ExpectRefused([parent] { return kill(parent, 0); });
  ExpectAllowed([] { return kill(getpid(), 0); });
  needs_.runs_programs = true;
  if (LandlockVersion() < kLandlockScopes) GTEST_SKIP() << "the kernel is older than Linux 6.12";
  ExpectRefused([parent] { return kill(parent, 0); });
}

}  // namespace
}  // namespace pepeseg
