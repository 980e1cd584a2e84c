// What a worker could be made to do by a file that it decodes: each tried in a process of its own
// that has entered the sandbox.
#include "server/jobs/worker_sandbox.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/landlock.h>
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
#include <termios.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <string>
#include <thread>

#include "server/jobs/sanitizers.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

constexpr int kNotEntered = 255;

// 0: the call went well; else its errno.
int ErrorOf(long result) { return result >= 0 ? 0 : errno; }

bool HasLandlock() {
  return syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION) >= 2;
}

class WorkerSandboxTest : public ::testing::Test {
 protected:
  WorkerSandboxTest() : needs_{folder_ / "job", false, false} {
    std::filesystem::create_directories(needs_.folder);
    std::filesystem::create_directories(folder_ / "tmp");
    setenv("TMPDIR", (folder_ / "tmp").c_str(), 1);
    std::ofstream(folder_ / "outside") << "of another job";
  }
  ~WorkerSandboxTest() override { unsetenv("TMPDIR"); }

  // How a process ends that enters the sandbox and does `act`, as waitpid tells it.
  int Try(const std::function<int()>& act) {
    const pid_t pid = fork();
    if (pid == 0) _exit(EnterSandbox(needs_).ok() ? act() : kNotEntered);
    int status = 0;
    EXPECT_EQ(waitpid(pid, &status, 0), pid);
    return status;
  }
  void ExpectRefused(const std::function<long()>& call, int error = EPERM) {
    const int status = Try([&] { return ErrorOf(call()); });
    EXPECT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
    EXPECT_EQ(WEXITSTATUS(status), error);
  }
  void ExpectAllowed(const std::function<long()>& call) { ExpectRefused(call, 0); }
  void ExpectKilled(const std::function<long()>& call) {
    const int status = Try([&] { return ErrorOf(call()); });
    EXPECT_TRUE(WIFSIGNALED(status)) << "exit code " << WEXITSTATUS(status);
    EXPECT_EQ(WTERMSIG(status), SIGSYS);
  }
  long Open(const std::string& name, int flags) const {
    return open((folder_ / name).c_str(), flags | O_CLOEXEC, 0600);
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

long ConnectToLoopback() {
  const int end = socket(AF_INET, SOCK_STREAM, 0);
  if (end < 0) return -1;
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(1);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return connect(end, reinterpret_cast<sockaddr*>(&address), sizeof(address));
}

TEST_F(WorkerSandboxTest, HasNoNetwork) {
  for (const bool more : {false, true}) {
    needs_.runs_programs = needs_.has_device = more;
    ExpectRefused(ConnectToLoopback);
    for (const int family : {AF_INET, AF_INET6, AF_NETLINK, AF_PACKET, AF_VSOCK}) {
      ExpectRefused([&] { return socket(family, SOCK_DGRAM, 0); });
    }
    ExpectRefused([] { return syscall(SYS_io_uring_setup, 8, nullptr); });
  }
}

TEST_F(WorkerSandboxTest, HasLocalSocketsWhereADriverOrAProgramNeedsThem) {
  const auto local = [] { return socket(AF_UNIX, SOCK_STREAM, 0); };
  ExpectRefused(local);
  needs_.has_device = true;
  ExpectAllowed(local);
  needs_.has_device = false;
  needs_.runs_programs = true;
  ExpectAllowed(local);
}

TEST_F(WorkerSandboxTest, RunsProgramsOnlyWhenTheJobDoes) {
  ExpectRefused([] { return execl("/bin/true", "true", nullptr); });
  if (!kSanitized) ExpectRefused([] { return fork(); });
  needs_.has_device = true;
  ExpectRefused([] { return execl("/bin/true", "true", nullptr); });
  needs_.runs_programs = true;
  ExpectAllowed([this] { return Exec(); });
}

// Bytes through the filter of its child too.
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

TEST_F(WorkerSandboxTest, WritesOnlyBelowItsFolders) {
  if (!HasLandlock()) GTEST_SKIP() << "the kernel has no Landlock";
  for (const bool more : {false, true}) {
    needs_.runs_programs = needs_.has_device = more;
    ExpectRefused([this] { return Open("outside", O_WRONLY); }, EACCES);
    ExpectRefused([this] { return Open("outside", O_RDWR | O_APPEND); }, EACCES);
    ExpectRefused([this] { return Open("new", O_WRONLY | O_CREAT); }, EACCES);
    ExpectRefused([this] { return unlink((folder_ / "outside").c_str()); }, EACCES);
    ExpectRefused([this] { return mkdir((folder_ / "new").c_str(), 0700); }, EACCES);
    ExpectRefused([this] { return symlink("/", (folder_ / "new").c_str()); }, EACCES);
    ExpectRefused(
        [this] { return rename((folder_ / "outside").c_str(), (needs_.folder / "taken").c_str()); },
        EACCES);
    ExpectRefused([this] { return truncate((folder_ / "outside").c_str(), 0); });
    ExpectRefused([] { return open("/dev/tty", O_WRONLY | O_CLOEXEC); }, EACCES);
    ExpectRefused([] { return open("/etc/passwd", O_WRONLY | O_CLOEXEC); }, EACCES);
    ExpectAllowed([this] { return Open("outside", O_RDONLY); });
    ExpectAllowed([this] { return Open("job/new", O_WRONLY | O_CREAT); });
    ExpectAllowed([this] { return Open("tmp/new", O_WRONLY | O_CREAT | O_TRUNC); });
    ExpectAllowed([] { return open("/dev/null", O_RDWR | O_CLOEXEC); });
  }
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
    ExpectRefused([this] { return mknod((needs_.folder / "disk").c_str(), S_IFBLK, 0x800); });
    ExpectRefused([this] { return chown((folder_ / "outside").c_str(), 1, 1); });
    ExpectRefused([] { return setsid(); });
  }
}

TEST_F(WorkerSandboxTest, KeepsItsLimits) {
  const rlimit more{RLIM_INFINITY, RLIM_INFINITY};
  rlimit now{};
  ExpectAllowed([&] { return getrlimit(RLIMIT_DATA, &now); });
  ExpectRefused([&] { return setrlimit(RLIMIT_DATA, &more); });
  needs_.has_device = true;
  const pid_t parent = getpid();
  ExpectRefused([&] { return prlimit(parent, RLIMIT_DATA, nullptr, &now); });
}

TEST_F(WorkerSandboxTest, TypesIntoNoTerminal) {
  char typed = 'x';
  for (const unsigned long high : {0UL, 1UL << 32}) {
    ExpectRefused([&] { return syscall(SYS_ioctl, 0, high | TIOCSTI, &typed); });
  }
  // Any other request reaches the device.
  ExpectRefused([] { return syscall(SYS_ioctl, -1, 0xc0384601UL, nullptr); }, EBADF);
  termios settings{};
  ExpectRefused([&] { return syscall(SYS_ioctl, -1, TCGETS, &settings); }, EBADF);
}

TEST_F(WorkerSandboxTest, DiesOfWhatOnlyAnAttackDoes) {
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
  if (syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION) < 6) {
    GTEST_SKIP() << "the kernel is older than Linux 6.12";
  }
  const pid_t parent = getpid();
  ExpectRefused([parent] { return kill(parent, 0); });
  ExpectAllowed([] { return kill(getpid(), 0); });
}

}  // namespace
}  // namespace pepeseg
