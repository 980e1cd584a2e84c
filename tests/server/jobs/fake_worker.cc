// A fake of pepeseg-worker for the supervisor's tests. It has the same protocol in the job's
// folder, and does what the name of the dataset's first file says.
#include <sys/prctl.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "core/base/digest.h"
#include "server/worker_protocol/event_log.h"
#include "server/worker_protocol/heartbeat.h"
#include "server/worker_protocol/job_folder.h"

namespace pepeseg {
namespace {

volatile std::sig_atomic_t terminated = 0;

void OnTerminate(int) { terminated = 1; }

int End(const JobFolder& folder, int64_t fence, WorkerExit exit, const JobResult& result) {
  return folder.WriteResult(fence, result).ok() ? static_cast<int>(exit) : 99;
}

int HangUntilTerminated(const JobFolder& folder, int64_t fence) {
  while (terminated == 0) usleep(1000);
  JobResult result;
  result.status = absl::CancelledError("stopped at step 3");
  return End(folder, fence, WorkerExit::kCancelled, result);
}

// Replaces everything that the server reads by links to the file "victim" next to the folder of the
// jobs, as code that has taken over a worker could without a sandbox.
int PlantLinks(const JobFolder& folder, int64_t fence) {
  namespace fs = std::filesystem;
  const fs::path victim = folder.path().parent_path().parent_path() / "victim";
  const std::string number = std::to_string(fence);
  const fs::path work = folder.work();
  for (const std::string& name :
       {"events-" + number + ".log", "events-" + number + "-end.log", "result-" + number + ".json",
        "pulse-" + number, "attempt-" + number, std::string("tmp-link")}) {
    fs::remove_all(work / name);
    fs::create_symlink(victim, work / name);
  }
  return 42;
}

int Succeed(const JobFolder& folder, int64_t fence) {
  JobResult result;
  result.metrics["psnr"] = 20.5;
  result.num_gaussians = 7;
  result.sources = {{"poses", "given"}, {"masks", "command \"x\""}, {"depth", "none"}};
  std::filesystem::create_directories(folder.attempt(fence));
  std::ofstream(folder.attempt(fence) / "gaussians.ply") << "ply";
  return End(folder, fence, WorkerExit::kSucceeded, result);
}

// "verify" reads the files as the worker does. "claim damage" reports intact files as damaged, and
// a file that is not the job's.
int Verify(const std::string& act, const JobFolder& folder, int64_t fence) {
  const auto spec = folder.ReadSpec(fence);
  if (!spec.ok()) return 98;
  JobResult result;
  for (const JobSpecFile& file : spec->files) {
    const bool whole = Sha256OfFile(file.path).value_or("") == file.sha256;
    if (whole && act == "verify") continue;
    result.damaged.push_back(file.sha256);
    result.status = absl::DataLossError(file.name + ": its stored bytes are damaged");
  }
  if (result.status.ok()) return Succeed(folder, fence);
  result.damaged.emplace_back("../../pepeseg.db");
  return End(folder, fence, WorkerExit::kFailed, result);
}

int Act(const std::string& act, const JobFolder& folder, int64_t fence) {
  if (act == "plant links") return PlantLinks(folder, fence);
  if (act == "curse") {
    JobResult result;
    result.status = absl::InternalError("\x1b[2J /srv/secret/place: " + std::string(100'000, 'x'));
    return End(folder, fence, WorkerExit::kFailed, result);
  }
  if (act == "crash with a curse") {
    std::fprintf(stderr, "\x1b[2J /srv/secret/place\n");
    std::abort();
  }
  if (act == "model with a link") {
    std::filesystem::create_directories(folder.attempt(fence));
    std::filesystem::create_symlink(folder.path().parent_path().parent_path() / "victim",
                                    folder.attempt(fence) / "gaussians.ply");
    return End(folder, fence, WorkerExit::kSucceeded, {});
  }
  if (act == "fail") {
    JobResult result;
    result.status = absl::InvalidArgumentError("images/bad.jpg: it is not a photograph");
    return End(folder, fence, WorkerExit::kFailed, result);
  }
  if (act == "verify" || act == "claim damage") return Verify(act, folder, fence);
  if (act == "crash") std::abort();
  if (act == "exit42") return 42;
  if (act == "lie") return 0;  // exits with success, and writes no result
  if (act == "hang") return HangUntilTerminated(folder, fence);
  while (act == "deaf") usleep(1000);
  if (act == "crash once" && fence == 1) std::abort();
  if (act == "crash at 4" && fence == 4) std::abort();
  if (act == "save and crash three times" && fence <= 3) {
    std::filesystem::create_directories(folder.checkpoints(fence));
    std::ofstream(folder.checkpoints(fence) / "reconstruct-000000100.ckpt") << "state";
    std::abort();
  }
  // Until it has been stopped as often as the last letter says.
  if (act.starts_with("save and hang") && fence <= act.back() - '0') {
    std::filesystem::create_directories(folder.checkpoints(fence));
    std::ofstream(folder.checkpoints(fence) / "reconstruct-000000100.ckpt") << "state";
    return HangUntilTerminated(folder, fence);
  }
  if (act == "stop once" && fence == 1) raise(SIGSTOP);
  if (act == "work a while") sleep(1);
  if (act == "be terminated once" && fence == 1) {
    raise(SIGTERM);
    return HangUntilTerminated(folder, fence);
  }
  if (act == "hang once" && fence == 1) return HangUntilTerminated(folder, fence);
  return Succeed(folder, fence);
}

int Run(const std::string& path) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  std::signal(SIGTERM, OnTerminate);
  const JobFolder folder(path);
  const auto spec = folder.ReadSpec(folder.NewestFence());
  auto log = EventLogWriter::Open(folder.events(), spec.ok() ? spec->fence : 0, EventPart::kWorker);
  if (!spec.ok() || !log.ok() || spec->files.empty()) return 98;
  if (spec->files[0].name == "deaf") std::signal(SIGTERM, SIG_IGN);
  const WorkerHeartbeat heartbeat(folder.heartbeat(spec->fence), folder.lease(spec->fence),
                                  std::chrono::seconds(spec->lease_seconds),
                                  [] { _exit(static_cast<int>(WorkerExit::kLeaseLost)); });
  std::fprintf(stderr, "the fake worker writes to its log\n");
  v1::JobEvent event;
  event.mutable_stage_started()->set_stage(v1::JOB_STAGE_RECONSTRUCT);
  if (!(*log)->Append(event).ok()) return 97;
  for (int step = 1; step <= 3; ++step) {
    event.mutable_progress()->set_stage(v1::JOB_STAGE_RECONSTRUCT);
    event.mutable_progress()->set_step(step);
    event.mutable_progress()->set_num_steps(10);
    if (!(*log)->Append(event).ok()) return 97;
  }
  return Act(spec->files[0].name, folder, spec->fence);
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) {
  const std::string flag = argc > 1 ? argv[1] : "";
  return flag.starts_with("--job=") ? pepeseg::Run(flag.substr(6)) : 96;
}
