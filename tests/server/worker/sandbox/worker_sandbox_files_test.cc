// Files that code in a worker could read, write and change without the sandbox. Each attempt runs
// in its own process, which has entered the sandbox.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <linux/fs.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <sys/xattr.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <string>

#include "server/worker_protocol/heartbeat.h"
#include "server/worker_protocol/job_isolation.h"
#include "tests/server/worker/sandbox/worker_sandbox_fixture.h"

namespace pepeseg {
namespace {

constexpr long kFchmodat2 = 452;  // newer than the headers of Debian 12

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

}  // namespace
}  // namespace pepeseg
