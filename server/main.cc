// pepesegd: the server, and the commands `pepesegd keys`.
//
// The main thread starts the server, waits for SIGTERM or SIGINT, and shuts it down. All other
// threads are the server's, but for one that ends the process if the shutdown hangs.
#include <malloc.h>
#include <pthread.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>
#include <thread>

#include "absl/time/clock.h"
#include "core/base/file_io.h"
#include "server/flags.h"
#include "server/keys_command.h"
#include "server/observe/log.h"
#include "server/server.h"

namespace {

// Blocks SIGTERM and SIGINT, and returns them for sigwait. Called before there is any other thread:
// each inherits the mask, so that only sigwait takes the signals. Ignores SIGPIPE.
sigset_t BlockStopSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  return signals;
}

// Raises the soft limit on open files to the hard limit: each connection and each open file takes a
// descriptor, and shells and service managers start programs with a soft limit of 1,024.
void RaiseDescriptorLimit() {
  constexpr rlim_t kFew = 8192;  // warns below it
  // More are of no use, and a child process may close every possible descriptor one by one.
  constexpr rlim_t kMost = rlim_t{1} << 20;
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  const rlimit raised = {std::max(limit.rlim_cur, std::min(limit.rlim_max, kMost)), limit.rlim_max};
  if (raised.rlim_cur > limit.rlim_cur && setrlimit(RLIMIT_NOFILE, &raised) != 0) {
    spdlog::warn("cannot raise the limit on open files from {} to {}: {}", limit.rlim_cur,
                 raised.rlim_cur, strerror(errno));
  } else {
    limit = raised;
  }
  if (limit.rlim_cur >= kFew) return;
  spdlog::warn(
      "the limit on open files is {}: under {} connections are refused early; raise the hard limit "
      "(ulimit -Hn, LimitNOFILE= of systemd, --ulimit nofile= of Docker)",
      limit.rlim_cur, kFew);
}

// Makes the allocator give large blocks back when they are freed. By default glibc raises its
// threshold to the largest block that was freed, up to 32 MiB; from then on maps of a photograph's
// size stay with the process, where no budget counts them (250 MiB became 3.3 GiB).
void ReturnLargeBlocks() {
  constexpr int kThreshold = 1 << 20;  // bytes
  mallopt(M_MMAP_THRESHOLD, kThreshold);
  // The blocks below it stay with the thread, up to this number of bytes: else each answer with a
  // mask of a megapixel gets its pages from the kernel again, a quarter of the answer's time.
  mallopt(M_TRIM_THRESHOLD, 2 * kThreshold);
}

// Ends the process at `deadline` with EXIT_FAILURE if it still runs, even if threads hang. Running
// jobs survive this as they survive a kill.
void EndProcessAt(absl::Time deadline) {
  std::thread([deadline] {
    absl::SleepFor(deadline - absl::Now());
    spdlog::critical("not stopped in time: something is stuck; the process ends without it");
    std::_Exit(EXIT_FAILURE);
  }).detach();
  // In case that thread hangs in the log: SIGALRM's default action ends the process.
  constexpr absl::Duration kToWriteLog = absl::Seconds(2);  // alarm() counts whole seconds
  const absl::Duration left = deadline + kToWriteLog - absl::Now();
  alarm(static_cast<unsigned int>(std::max<int64_t>(1, absl::ToInt64Seconds(left))));
}

// Shuts the server down within `within`, or ends the process.
void Stop(pepeseg::Server& server, absl::Duration within) {
  constexpr absl::Duration kMostToClose = absl::Seconds(1);
  const absl::Time start = absl::Now();
  EndProcessAt(start + std::max(within, kMostToClose));
  // The last tenth, at most 1 s, is for what follows the last call: closing the database and the
  // log.
  server.Shutdown(start + within - std::min(kMostToClose, within / 10));
}

// Serves until a stop signal, and returns the exit code.
int Serve(pepeseg::Flags flags, const sigset_t& stop_signals) {
  std::atomic<bool> unreachable = false;
  flags.server.on_unreachable = [&unreachable] {
    unreachable = true;
    kill(getpid(), SIGTERM);  // for sigwait below
  };
  RaiseDescriptorLimit();
  auto server = pepeseg::Server::Start(flags.server);
  if (!server.ok()) {
    spdlog::critical("cannot start: {}", std::string(server.status().message()));
    return EXIT_FAILURE;
  }
  const int port = (*server)->port();
  if (!flags.port_file.empty()) {
    const auto written = pepeseg::WriteFileAtomically(flags.port_file, std::to_string(port) + "\n");
    if (!written.ok()) {
      spdlog::critical("cannot write the port file: {}", std::string(written.message()));
      return EXIT_FAILURE;
    }
  }
  spdlog::info("serving on {}, port {}, data in {}", flags.server.listen, port,
               flags.server.data.string());
  if (!flags.server.admin.empty()) {
    spdlog::info("serving admin calls on {}, port {}", flags.server.admin, (*server)->admin_port());
  }
  if (!flags.server.metrics.empty()) {
    spdlog::info("metrics on {}, port {}", flags.server.metrics, (*server)->metrics_port());
  }
  int signal = 0;
  sigwait(&stop_signals, &signal);
  const absl::Duration within = flags.server.drain + absl::Seconds(flags.grace_seconds);
  spdlog::info("signal {}: stopping, within {} s", signal, absl::ToInt64Seconds(within));
  Stop(**server, within);
  spdlog::info("stopped");
  if (!unreachable) return EXIT_SUCCESS;
  spdlog::critical("ended because new clients got no answer; the exit code asks for a restart");
  return EXIT_FAILURE;
}

// Runs a command that takes the place of serving, and returns the exit code.
int RunCommand(const std::function<absl::Status()>& command) {
  const absl::Status status = command();
  if (status.ok()) return EXIT_SUCCESS;
  std::fprintf(stderr, "pepesegd: %s\n", std::string(status.message()).c_str());
  return EXIT_FAILURE;
}

}  // namespace

// An exception before it serves may end the process.  NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  pepeseg::Flags flags;
  CLI::App app("The pepeseg server: scenes from photographs, segments from clicks", "pepesegd");
  app.set_version_flag("--version", "pepesegd " PEPESEG_VERSION, "Print the version and exit");
  pepeseg::AddFlags(app, flags);
  std::function<absl::Status()> command;  // set by `pepesegd keys`: runs instead of the server
  pepeseg::AddKeysCommand(app, flags.server, command);
  CLI11_PARSE(app, argc, argv);
  pepeseg::ConfigureLog(*pepeseg::LogFormatOf(flags.server.workers.log_format));
  spdlog::set_level(spdlog::level::from_str(flags.log_level));
  ReturnLargeBlocks();
  const sigset_t stop_signals = BlockStopSignals();
  pepeseg::MakePathsAbsolute(flags);
  if (command) return RunCommand(command);
  return Serve(flags, stop_signals);
}
