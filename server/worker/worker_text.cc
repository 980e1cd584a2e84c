#include "server/worker/worker_text.h"

#include <cstdio>
#include <cstdlib>
#include <system_error>
#include <vector>

#include "core/base/child_process.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "server/worker/group_guard.h"
#include "server/worker/sandbox/worker_limits.h"
#include "server/worker/sandbox/worker_sandbox.h"
#include "server/worker_protocol/job_isolation.h"
#include "server/worker_protocol/text_task.h"

namespace pepeseg {
namespace {

// Leaves the variables that programs of a job may have. TMPDIR is below the folder of the answers.
absl::Status SetEnvironment(const TextTask& task) {
  const std::vector<std::string> variables = JobEnvironment(task.pass_environment);
  clearenv();
  for (const std::string& variable : variables) {
    const size_t end = variable.find('=');
    setenv(variable.substr(0, end).c_str(), variable.substr(end + 1).c_str(), /*overwrite=*/1);
  }
  const std::filesystem::path temporary = TextAnswers(task.folder) / "tmp";
  std::error_code error;
  std::filesystem::create_directory(temporary, error);
  if (error) return FileError(temporary, "make", error.value());
  setenv("TMPDIR", temporary.c_str(), /*overwrite=*/1);
  return absl::OkStatus();
}

absl::Status RunTextProgram(const TextTask& task) {
  RETURN_IF_ERROR(LimitResources(task.memory_limit, task.num_threads));
  YieldToServer();
  RETURN_IF_ERROR(SetEnvironment(task));
  RETURN_IF_ERROR(GuardGroup());
  if (task.sandbox) {
    SandboxNeeds needs;
    needs.reads = {TextPhotos(task.folder)};
    needs.writes = {TextAnswers(task.folder)};
    needs.runs_programs = true;
    needs.programs = {task.program};
    for (const std::string& path : task.sandbox_reads) needs.programs.emplace_back(path);
    RETURN_IF_ERROR(EnterSandbox(needs));
  }
  ChildCommand command;
  command.program = task.program;
  command.arguments = {"--photos", TextPhotos(task.folder).string(), "--text", task.text,
                       "--out",    TextAnswers(task.folder).string()};
  command.log = TextLog(task.folder);
  command.time_limit = task.time_limit;
  ASSIGN_OR_RETURN(const ChildEnd end, RunChild(command, [](std::span<const std::string>) {
                     return absl::OkStatus();
                   }));
  if (end.signal == 0 && end.exit_code == 0) return absl::OkStatus();
  return absl::FailedPreconditionError(Describe(end));
}

}  // namespace

WorkerExit RunTextTask(const std::string& task) {
  const absl::StatusOr<TextTask> parsed = ParseTextTask(task);
  const absl::Status status = parsed.ok() ? RunTextProgram(*parsed) : parsed.status();
  if (status.ok()) return WorkerExit::kSucceeded;
  std::fprintf(stderr, "%s\n", std::string(status.message()).c_str());
  return WorkerExit::kFailed;
}

}  // namespace pepeseg
