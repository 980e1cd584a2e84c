// The worker program inside its sandbox, and the programs that it runs.
#include <sys/stat.h>

#include <csignal>
#include <fstream>
#include <sstream>

#include "tests/server/jobs/worker_fixture.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;

class WorkerSandboxedTest : public WorkerTest {
 protected:
  // A priors command that tries to have a socket of the network, and to write beside the job's
  // folder; "tried" is what came of it.
  void UseCommandThatTries() {
    std::erase_if(spec_.files, [](const JobSpecFile& file) {
      return file.kind != v1::FILE_KIND_IMAGE && file.kind != v1::FILE_KIND_POSES;
    });
    spec_.options.mutable_reconstruct()->set_num_steps(5);
    const std::filesystem::path path = folder_ / "tries";
    std::ofstream(path)
        << "#!/usr/bin/python3\n"
           "import os, pathlib, socket\n"
           "said = []\n"
           "for attempt in (lambda: socket.socket(socket.AF_INET),\n"
           "                lambda: open('"
        << (folder_ / "beside").string()
        << "', 'w')):\n"
           "  try:\n"
           "    attempt()\n"
           "    said.append('done')\n"
           "  except PermissionError:\n"
           "    said.append('refused')\n"
           "(pathlib.Path(os.environ['TMPDIR']) / 'tried').write_text(' '.join(said))\n";
    ASSERT_EQ(chmod(path.c_str(), 0700), 0);
    flags_ = {"--priors-command=" + path.string()};
    // /tmp, where the job stands in this test, is not written to then.
    std::filesystem::create_directories(job_.path() / "tmp");
    setenv("TMPDIR", (job_.path() / "tmp").c_str(), 1);
  }
  ~WorkerSandboxedTest() override { unsetenv("TMPDIR"); }

  std::string Tried() { return ReadFile(job_.path() / "tmp" / "tried", "tried", 100).value_or(""); }
};

TEST_F(WorkerSandboxedTest, TrainsBehindAFilterThatItCannotLeave) {
  spec_.options.mutable_reconstruct()->set_num_steps(1'000'000);
  const auto worker = Launch(getpid());
  std::string status;
  for (int i = 0; i < 6000 && status.find("Seccomp:\t2") == std::string::npos; ++i) {
    absl::SleepFor(absl::Milliseconds(10));
    std::ifstream file(absl::StrCat("/proc/", worker->pid(), "/status"));
    std::stringstream text;
    text << file.rdbuf();
    status = text.str();
  }
  EXPECT_THAT(status, HasSubstr("Seccomp:\t2"));
  EXPECT_THAT(status, HasSubstr("NoNewPrivs:\t1"));
  worker->Signal(SIGKILL);
  WaitFor(*worker);
}

TEST_F(WorkerSandboxedTest, ItsCommandHasNoNetworkAndWritesNowhereElse) {
  UseCommandThatTries();
  Run();
  // Where the kernel has no Landlock, the log says so.
  const std::string log = ReadFileTail(job_.worker_log(), 100'000);
  const bool limited = log.find("writing is not limited") == std::string::npos;
  EXPECT_EQ(Tried(), limited ? "refused refused" : "refused done");
}

TEST_F(WorkerSandboxedTest, WithoutItTheCommandDoesAsItLikes) {
  UseCommandThatTries();
  flags_.emplace_back("--sandbox=off");
  Run();
  EXPECT_EQ(Tried(), "done done");
}

}  // namespace
}  // namespace pepeseg
