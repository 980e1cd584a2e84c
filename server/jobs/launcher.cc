// Workers as child processes, by posix_spawn: a fork of the server would copy its page tables, and
// could meet locks that other threads hold.
#include "server/jobs/launcher.h"

#include <fcntl.h>
#include <spawn.h>
#include <spdlog/spdlog.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/child_process.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "server/worker_protocol/job_isolation.h"

namespace pepeseg {
namespace {

// posix_spawn's settings, freed with their scope.
struct SpawnSettings {
  SpawnSettings() {
    posix_spawn_file_actions_init(&files);
    posix_spawnattr_init(&attributes);
  }
  ~SpawnSettings() {
    posix_spawn_file_actions_destroy(&files);
    posix_spawnattr_destroy(&attributes);
  }
  SpawnSettings(const SpawnSettings&) = delete;
  SpawnSettings& operator=(const SpawnSettings&) = delete;

  posix_spawn_file_actions_t files{};
  posix_spawnattr_t attributes{};
};

// Opens the standard files, closes all others, and resets signals and the process group.
void Isolate(SpawnSettings& settings, const std::filesystem::path& log,
             const StandardFiles& files) {
  if (files.input >= 0) {
    posix_spawn_file_actions_adddup2(&settings.files, files.input, STDIN_FILENO);
  } else {
    posix_spawn_file_actions_addopen(&settings.files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  }
  posix_spawn_file_actions_addopen(&settings.files, STDERR_FILENO, log.c_str(),
                                   O_WRONLY | O_CREAT | O_APPEND, 0644);
  posix_spawn_file_actions_adddup2(&settings.files,
                                   files.output >= 0 ? files.output : STDERR_FILENO, STDOUT_FILENO);
  // The server's sockets, locks and database must not be open in a process that decodes uploads.
  posix_spawn_file_actions_addclosefrom_np(&settings.files, STDERR_FILENO + 1);
  sigset_t none;
  sigemptyset(&none);
  posix_spawnattr_setsigmask(&settings.attributes, &none);
  sigset_t all;
  sigfillset(&all);
  posix_spawnattr_setsigdefault(&settings.attributes, &all);
  // A group of its own, so that Ctrl-C at a terminal reaches the server only, which then stops its
  // workers in order.
  posix_spawnattr_setpgroup(&settings.attributes, 0);
  posix_spawnattr_setflags(&settings.attributes,
                           POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
}

class ProcessLauncher final : public Launcher {
 public:
  absl::StatusOr<std::unique_ptr<LaunchedWorker>> Launch(const WorkerCommand& command) override {
    WorkerCommand child = command;
    child.arguments.push_back(absl::StrCat("--parent=", getpid()));
    for (std::string& variable : JobEnvironment(command.pass_environment)) {
      child.environment.push_back(std::move(variable));
    }
    child.inherits_environment = false;
    ASSIGN_OR_RETURN(std::unique_ptr<WorkerProcess> process, WorkerProcess::Launch(child));
    spdlog::info("jobs/{}: runs as process {}", command.job, process->pid());
    return process;
  }
  absl::StatusOr<std::unique_ptr<LaunchedWorker>> Attach(const std::string& launch) override {
    return absl::NotFoundError(absl::StrCat("'", launch, "' is run by another launcher"));
  }
};

}  // namespace

std::unique_ptr<Launcher> MakeProcessLauncher() { return std::make_unique<ProcessLauncher>(); }

absl::StatusOr<std::unique_ptr<WorkerProcess>> WorkerProcess::Launch(const WorkerCommand& command,
                                                                     const StandardFiles& files) {
  SpawnSettings settings;
  Isolate(settings, command.log, files);
  std::vector<std::string> words = {command.program.string()};
  words.insert(words.end(), command.arguments.begin(), command.arguments.end());
  // getenv() finds the first of several variables with one name, so `environment` comes first.
  std::vector<std::string> variables = command.environment;
  for (char** variable = environ; command.inherits_environment && *variable != nullptr;
       ++variable) {
    variables.emplace_back(*variable);
  }
  pid_t pid = 0;
  const int error =
      posix_spawn(&pid, command.program.c_str(), &settings.files, &settings.attributes,
                  Pointers(words).data(), Pointers(variables).data());
  if (error != 0) return FileError(command.program, "launch", error);
  return std::unique_ptr<WorkerProcess>(new WorkerProcess(pid));
}

WorkerProcess::~WorkerProcess() {
  // A worker must not outlive its handle, and must be reaped.
  if (Poll()) return;
  Signal(SIGKILL);
  int status = 0;
  while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
}

std::optional<WorkerEnd> WorkerProcess::Poll() {
  int status = 0;
  if (!end_ && waitpid(pid_, &status, WNOHANG) == pid_) {
    const bool killed = WIFSIGNALED(status);
    const ChildEnd end = killed ? ChildEnd{0, WTERMSIG(status)} : ChildEnd{WEXITSTATUS(status), 0};
    end_ = WorkerEnd{killed ? WorkerEnd::Kind::kKilled : WorkerEnd::Kind::kExited, end.exit_code,
                     end.signal, Describe(end)};
  }
  return end_;
}

void WorkerProcess::Signal(int signal) const {
  // Once it is reaped, its process id may belong to another process.
  if (!end_) kill(pid_, signal);
}

}  // namespace pepeseg
