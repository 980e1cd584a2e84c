#include "core/base/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr int kPollMilliseconds = 50;
constexpr int64_t kMaxLogBytes = int64_t{16} << 20;
constexpr size_t kMaxLineBytes = 4096;  // longer lines are cut into several

absl::Status SystemError(const std::string& what) {
  return absl::InternalError(absl::StrCat(what, ": ", std::generic_category().message(errno)));
}

// A pipe that closes its ends. Other children do not inherit them (O_CLOEXEC).
struct Pipe {
  ~Pipe() {
    CloseWriter();
    if (reader >= 0) close(reader);
  }
  absl::Status Open() {
    std::array<int, 2> ends{};
    if (pipe2(ends.data(), O_CLOEXEC) != 0) return SystemError("pipe");
    reader = ends[0];
    writer = ends[1];
    return absl::OkStatus();
  }
  // The parent must close its writer, or else it would never read the end of the output.
  void CloseWriter() {
    if (writer >= 0) close(writer);
    writer = -1;
  }
  int reader = -1;
  int writer = -1;
};

// Returns `own`, then the variables of this process that `own` does not set.
std::vector<std::string> Environment(const std::vector<std::string>& own) {
  std::vector<std::string> words = own;
  for (char** entry = environ; entry != nullptr && *entry != nullptr; ++entry) {
    const std::string word = *entry;
    const std::string name = word.substr(0, word.find('=') + 1);
    const bool replaced = std::any_of(
        own.begin(), own.end(), [&](const std::string& other) { return other.starts_with(name); });
    if (!replaced) words.push_back(word);
  }
  return words;
}

// Everything that the new process needs, allocated before the fork. If the parent has several
// threads, the child may call only async-signal-safe functions until exec: another thread may have
// held the allocator's lock at the fork.
class Launch {
 public:
  explicit Launch(const ChildCommand& command)
      : program_(command.program.string()), environment_(Environment(command.environment)) {
    words_.push_back(program_);
    words_.insert(words_.end(), command.arguments.begin(), command.arguments.end());
  }

  // Starts the program with its output going to the descriptor `output`, and returns its process
  // id. Returns NOT_FOUND if exec failed: the child reports its errno through a second pipe.
  absl::StatusOr<pid_t> Start(int output) {
    std::vector<char*> argv = Pointers(words_);
    std::vector<char*> envp = Pointers(environment_);
    Pipe failure;
    RETURN_IF_ERROR(failure.Open());
    const pid_t parent = getpid();
    const pid_t pid = fork();
    if (pid < 0) return SystemError("fork");
    if (pid == 0) Become(argv.data(), envp.data(), {parent, output, failure.writer});
    failure.CloseWriter();
    int error = 0;
    // A successful exec closes the child's end of the pipe, so that the read returns 0.
    if (read(failure.reader, &error, sizeof(error)) != sizeof(error)) return pid;
    waitpid(pid, nullptr, 0);
    return absl::NotFoundError(absl::StrCat(program_, " cannot be run: ", std::strerror(error)));
  }

 private:
  struct Ends {
    pid_t parent;
    int output;
    int failure;
  };

  // Turns the forked child into the program. Only async-signal-safe calls.
  [[noreturn]] void Become(char** argv, char** envp, const Ends& ends) const {
    // A process group of its own, so that Reap can kill everything that the program has started.
    setpgid(0, 0);
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != ends.parent) _exit(127);  // the parent died before prctl took effect
    const int input = open("/dev/null", O_RDONLY | O_CLOEXEC);
    dup2(input, STDIN_FILENO);
    dup2(ends.output, STDOUT_FILENO);
    dup2(ends.output, STDERR_FILENO);
    // Other threads may have opened descriptors without O_CLOEXEC.
    close_range(STDERR_FILENO + 1, ~0U, CLOSE_RANGE_CLOEXEC);
    // exec() keeps the mask of blocked signals, and threads of the server block some.
    sigset_t none;
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, nullptr);
    execve(program_.c_str(), argv, envp);
    const int error = errno;
    const ssize_t ignored = write(ends.failure, &error, sizeof(error));
    _exit(ignored > 0 ? 127 : 126);
  }

  std::string program_;
  std::vector<std::string> words_, environment_;
};

// Splits the program's output into lines and copies it to the log.
class Output {
 public:
  explicit Output(const std::filesystem::path& log) : log_(log, std::ios::app) {}

  // Reads once. Returns false if there is nothing to read now.
  bool Read(int descriptor) {
    std::array<char, 16384> bytes{};
    const ssize_t size = read(descriptor, bytes.data(), bytes.size());
    if (size <= 0) return false;
    const absl::string_view text(bytes.data(), static_cast<size_t>(size));
    // Goes on reading when the log is full, so that the program does not block on its output.
    if (logged_ < kMaxLogBytes) log_ << text << std::flush;
    logged_ += size;
    for (const char c : text) Add(c);
    return true;
  }

  // Returns the complete lines since the last call. If `ended`, the last line may lack a newline.
  std::vector<std::string> Take(bool ended) {
    if (ended && !line_.empty()) lines_.push_back(std::move(line_));
    return std::exchange(lines_, {});
  }

 private:
  void Add(char c) {
    if (c != '\n') line_.push_back(c);
    if (c == '\n' || line_.size() >= kMaxLineBytes) lines_.push_back(std::exchange(line_, {}));
  }

  std::ofstream log_;
  int64_t logged_ = 0;
  std::string line_;
  std::vector<std::string> lines_;
};

// A running child process. The destructor kills it and its process group.
class Running {
 public:
  explicit Running(pid_t pid) : pid_(pid) {}
  ~Running() {
    if (!reaped_) Reap();
  }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

  // Returns whether the process has ended, and leaves it a zombie so that its id stays taken.
  bool HasEnded() const {
    siginfo_t info{};
    return waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
           info.si_pid == pid_;
  }

  // Kills what is left of the group, then reaps its leader and returns how it ended. In this order,
  // because the group's id cannot be reused before its leader is reaped.
  ChildEnd Reap() {
    kill(-pid_, SIGKILL);
    kill(pid_, SIGKILL);  // the child may not have called setpgid yet
    int status = 0;
    while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    reaped_ = true;
    return WIFSIGNALED(status) ? ChildEnd{0, WTERMSIG(status)} : ChildEnd{WEXITSTATUS(status), 0};
  }

 private:
  pid_t pid_;
  bool reaped_ = false;
};

absl::Status OverTime(const ChildCommand& command) {
  return absl::DeadlineExceededError(
      absl::StrCat(command.program.filename().string(), " was stopped after ",
                   absl::FormatDuration(command.time_limit), ", its time limit"));
}

}  // namespace

std::string Describe(const ChildEnd& end) {
  if (end.signal == 0) return absl::StrCat("exited with code ", end.exit_code);
  return absl::StrCat("was killed by signal ", end.signal, " (", strsignal(end.signal), ")");
}

std::vector<char*> Pointers(std::vector<std::string>& words) {
  std::vector<char*> pointers;
  pointers.reserve(words.size() + 1);
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  return pointers;
}

absl::StatusOr<std::filesystem::path> FindProgram(const std::string& name) {
  std::vector<std::filesystem::path> places;
  if (name.find('/') != std::string::npos) {
    places = {name};
  } else if (const char* path = std::getenv("PATH"); path != nullptr && !name.empty()) {
    for (absl::string_view folder : absl::StrSplit(path, ':', absl::SkipEmpty())) {
      places.push_back(std::filesystem::path(std::string(folder)) / name);
    }
  }
  for (const std::filesystem::path& place : places) {
    std::error_code ignored;
    if (std::filesystem::is_regular_file(place, ignored) && access(place.c_str(), X_OK) == 0) {
      return place;
    }
  }
  return absl::NotFoundError(absl::StrCat("the program ", name, " is not there"));
}

// Each round waits up to 50 ms for output, reads some, and passes complete lines to `watch`. After
// the program has ended and its group is killed, reads what is left in the pipe.
absl::StatusOr<ChildEnd> RunChild(const ChildCommand& command, ChildWatchFn watch) {
  const absl::Time deadline = absl::Now() + command.time_limit;
  Pipe pipe;
  RETURN_IF_ERROR(pipe.Open());
  Output output(command.log);
  ASSIGN_OR_RETURN(const pid_t pid, Launch(command).Start(pipe.writer));
  Running running(pid);
  pipe.CloseWriter();
  fcntl(pipe.reader, F_SETFL, O_NONBLOCK);
  ChildEnd end;
  for (bool ended = false; !ended;) {
    pollfd readable{pipe.reader, POLLIN, 0};
    const bool any = poll(&readable, 1, kPollMilliseconds) > 0;
    ended = running.HasEnded();
    if (ended) end = running.Reap();  // no process is left that could write
    const bool read = any && output.Read(pipe.reader);
    while (ended && output.Read(pipe.reader)) {
    }
    // The program has closed its output but still runs: poll() returns at once, so sleep instead.
    if (any && !read && !ended) absl::SleepFor(absl::Milliseconds(kPollMilliseconds));
    RETURN_IF_ERROR(watch(output.Take(ended)));
    if (!ended && absl::Now() > deadline) return OverTime(command);
  }
  return end;
}

}  // namespace pepeseg
