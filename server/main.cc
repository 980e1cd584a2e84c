// pepesegd: the server.
#include <pthread.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <functional>
#include <string>

#include "absl/time/clock.h"
#include "core/io/atomic_file.h"
#include "server/flags.h"
#include "server/keys_command.h"
#include "server/log.h"

namespace {

// Before there is any thread, so that all of them leave the signals to WaitForStop.
sigset_t BlockStopSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  return signals;
}

int Serve(const pepeseg::Flags& flags, const sigset_t& stop_signals) {
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
  (*server)->Shutdown(absl::Now() + within);
  spdlog::info("stopped");
  return EXIT_SUCCESS;
}

int RunCommand(const std::function<absl::Status()>& command) {
  const absl::Status status = command();
  if (status.ok()) return EXIT_SUCCESS;
  std::fprintf(stderr, "pepesegd: %s\n", std::string(status.message()).c_str());
  return EXIT_FAILURE;
}

}  // namespace

// What is thrown before it serves may end it.  NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  pepeseg::Flags flags;
  CLI::App app("The pepeseg server: scenes from photographs, segments from clicks", "pepesegd");
  pepeseg::AddFlags(app, flags);
  std::function<absl::Status()> command;  // in place of serving
  pepeseg::AddKeysCommand(app, flags.server, command);
  CLI11_PARSE(app, argc, argv);
  pepeseg::ConfigureLog(*pepeseg::LogFormatOf(flags.server.log_format));
  spdlog::set_level(spdlog::level::from_str(flags.log_level));
  const sigset_t stop_signals = BlockStopSignals();
  pepeseg::MakePathsAbsolute(flags);
  if (command) return RunCommand(command);
  return Serve(flags, stop_signals);
}
