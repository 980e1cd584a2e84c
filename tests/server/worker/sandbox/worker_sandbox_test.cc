// What code in a file that a worker decodes could try. Each attempt runs in its own process, which
// has entered the sandbox.
#include "server/worker/sandbox/worker_sandbox.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
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

#include <csignal>
#include <cstdlib>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "server/worker/sandbox/worker_limits.h"
#include "tests/server/worker/sandbox/listening_socket.h"
#include "tests/server/worker/sandbox/worker_sandbox_fixture.h"

namespace pepeseg {
namespace {
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
