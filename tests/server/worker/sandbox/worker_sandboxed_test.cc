// The worker program inside its sandbox, and the programs that it runs.
#include <sys/stat.h>

#include <csignal>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>

#include "absl/strings/match.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "server/worker_protocol/job_isolation.h"
#include "tests/server/worker/sandbox/listening_socket.h"
#include "tests/server/worker/worker_fixture.h"
#include "tests/testing/eventually.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;

// Returns a priors command that tries to reach what is not its job's, and prints the outcome of
// each attempt. `folder`: the test's folder; `server`: the process that started the worker.
constexpr char kProbe[] = R"(
import os, socket, sys
folder, server, port = FOLDER, SERVER, PORT
job = os.path.dirname(os.environ['TMPDIR'])
def connect(family, address):
  socket.socket(family).connect(address)
def pair():
  left, right = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
  left.sendto(b'x', folder + '/admin')
attempts = {
  'read another blob': lambda: open(folder + '/blob').read(),
  'read the database': lambda: open(folder + '/pepeseg.db').read(),
  'read the audit log': lambda: open(folder + '/audit.log').read(),
  'list the folder': lambda: os.listdir(folder),
  'read the environment of the server': lambda: open('/proc/%d/environ' % server).read(),
  'read the command line of the server': lambda: open('/proc/%d/cmdline' % server).read(),
  'read /etc/shadow': lambda: open('/etc/shadow').read(),
  'write a file': lambda: open(folder + '/beside', 'w'),
  'truncate a blob': lambda: os.open(folder + '/mine', os.O_RDONLY | os.O_TRUNC),
  'connect to the admin socket': lambda: connect(socket.AF_UNIX, folder + '/admin'),
  'send to a local socket': pair,
  'connect to the admin port': lambda: connect(socket.AF_INET, ('127.0.0.1', port)),
  'make a symbolic link': lambda: os.symlink(folder + '/audit.log', job + '/events-2.log'),
  'make a hard link': lambda: os.link(job + '/mine', job + '/events-3.log'),
  'make a FIFO': lambda: os.mkfifo(job + '/events-4.log'),
  'signal the server': lambda: os.kill(server, 0),
}
open(job + '/mine', 'w').write('x')
said = []
for name, attempt in attempts.items():
  try:
    attempt()
    said.append(name + ': done')
  except OSError as error:
    said.append(name + ': refused')
print('\n'.join(said), file=open(job + '/tried', 'w'))
)";

class WorkerSandboxedTest : public WorkerTest {
 protected:
  void UseProbe() {
    for (const char* name : {"blob", "pepeseg.db", "audit.log"}) {
      std::ofstream(folder_ / name) << "a secret";
    }
    std::erase_if(spec_.files, [](const JobSpecFile& file) {
      return file.kind != v1::FILE_KIND_IMAGE && file.kind != v1::FILE_KIND_POSES;
    });
    for (JobSpecFile& file : spec_.files) {
      if (file.kind != v1::FILE_KIND_IMAGE) continue;
      std::filesystem::copy_file(file.path, folder_ / "mine");
      file.path = folder_ / "mine";
      break;
    }
    spec_.options.mutable_reconstruct()->set_num_steps(5);
    const std::filesystem::path path = folder_ / "probe";
    std::ofstream(path) << "#!/usr/bin/python3\n"
                        << absl::StrReplaceAll(
                               kProbe, {{"FOLDER", absl::StrCat("'", folder_.path().string(), "'")},
                                        {"SERVER", absl::StrCat(getpid())},
                                        {"PORT", absl::StrCat(tcp_.port())}});
    ASSERT_EQ(chmod(path.c_str(), 0700), 0);
    spec_.worker.priors_command = path.string();
  }

  // Returns the outcome of each of the probe's attempts.
  std::map<std::string, std::string> Tried() {
    std::map<std::string, std::string> tried;
    const std::string text = ReadFile(job_.work() / "tried", "tried", 10'000).value_or("");
    for (const absl::string_view line : absl::StrSplit(text, '\n', absl::SkipEmpty())) {
      const std::pair<std::string, std::string> parts = absl::StrSplit(line, ": ");
      tried.insert(parts);
    }
    return tried;
  }

  const testing::ListeningSocket admin_{folder_ / "admin"};
  const testing::ListeningSocket tcp_;
};

TEST_F(WorkerSandboxedTest, TrainsInAFilterThatItCannotRemove) {
  spec_.options.mutable_reconstruct()->set_num_steps(1'000'000);
  const auto worker = Launch(getpid());
  std::string status;
  EXPECT_TRUE(testing::Eventually([&] {
    std::ifstream file(absl::StrCat("/proc/", worker->pid(), "/status"));
    std::stringstream text;
    text << file.rdbuf();
    status = text.str();
    return absl::StrContains(status, "Seccomp:\t2");
  }));
  EXPECT_THAT(status, HasSubstr("NoNewPrivs:\t1"));
  worker->Signal(SIGKILL);
  WaitFor(*worker);
}

// A worker of Slurm's gets the database's URL. The process that decodes uploads never had it.
TEST_F(WorkerSandboxedTest, DropsTheDatabaseUrlOfSlurmBeforeItReadsUploads) {
  spec_.options.mutable_reconstruct()->set_num_steps(1'000'000);
  setenv("PEPESEG_SLURM_DATABASE", "postgresql:host=nowhere password=secret", 1);
  setenv("PGPASSWORD", "secret", 1);
  const auto worker = Launch(getpid());
  unsetenv("PEPESEG_SLURM_DATABASE");
  unsetenv("PGPASSWORD");
  const std::string process = absl::StrCat("/proc/", worker->pid(), "/");
  const auto text = [&](const char* name) {
    std::ifstream file(process + name);
    return std::string((std::istreambuf_iterator<char>(file)), {});
  };
  EXPECT_TRUE(
      testing::Eventually([&] { return absl::StrContains(text("status"), "Seccomp:\t2"); }));
  EXPECT_THAT(text("environ"), HasSubstr("PATH="));
  EXPECT_THAT(text("environ"), ::testing::Not(HasSubstr("secret")));
  EXPECT_THAT(text("cmdline"), ::testing::Not(HasSubstr("secret")));
  EXPECT_THAT(text("cmdline"), HasSubstr("--fence=1"));
  worker->Signal(SIGKILL);
  WaitFor(*worker);
}

TEST_F(WorkerSandboxedTest, LimitsItsProgramsToTheJob) {
  if (LandlockVersion() < kLandlockScopes) GTEST_SKIP() << "needs Linux 6.12";
  UseProbe();
  Run();
  const std::map<std::string, std::string> tried = Tried();
  EXPECT_EQ(tried.size(), 16u) << ReadFileTail(job_.worker_log(), 4000);
  for (const auto& [attempt, outcome] : tried) EXPECT_EQ(outcome, "refused") << attempt;
  EXPECT_GT(std::filesystem::file_size(folder_ / "mine"), 0u);
}

// Proves that the probe's attempts succeed where nothing refuses them.
TEST_F(WorkerSandboxedTest, DoesNotLimitProgramsIfItIsOff) {
  UseProbe();
  spec_.worker.sandbox = false;
  Run();
  const std::map<std::string, std::string> tried = Tried();
  EXPECT_EQ(tried.size(), 16u) << ReadFileTail(job_.worker_log(), 4000);
  for (const auto& [attempt, outcome] : tried) {
    if (attempt == "send to a local socket") continue;  // no socket takes datagrams there
    if (attempt == "read /etc/shadow" && geteuid() != 0) continue;
    EXPECT_EQ(outcome, "done") << attempt;
  }
}

}  // namespace
}  // namespace pepeseg
