// pepesegd: the server.
#include <pthread.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <climits>
#include <csignal>
#include <filesystem>
#include <string>

#include "absl/time/clock.h"
#include "core/io/atomic_file.h"
#include "server/rpc/server.h"

namespace {

struct Flags {
  pepeseg::ServerOptions server;
  std::filesystem::path port_file;
  int grace_seconds = 10;
  std::string log_level = "info";
};

// The worker stands beside the server unless a flag says otherwise.
std::filesystem::path DefaultWorker() {
  std::error_code error;
  const auto self = std::filesystem::read_symlink("/proc/self/exe", error);
  return error ? "pepeseg-worker" : self.parent_path() / "pepeseg-worker";
}

void AddFlags(CLI::App& app, Flags& flags) {
  pepeseg::ServerOptions& server = flags.server;
  server.worker = DefaultWorker();
  app.add_option("--listen", server.listen, "HOST:PORT (port 0: a free one) or unix:PATH")
      ->capture_default_str();
  app.add_option("--admin", server.admin,
                 "HOST:PORT or unix:PATH of the admin service, which loads, unloads and pins "
                 "models; without it there is none");
  app.add_option("--data", server.data, "Data directory; made when it is not there")->required();
  app.add_option("--worker", server.worker, "The pepeseg-worker program")->capture_default_str();
  app.add_option("--device", server.device,
                 "auto, cpu, cuda or cuda:N; auto: CUDA where there is a device, else the CPU")
      ->capture_default_str();
  app.add_option("--lpips-weights", server.lpips_weights,
                 "ONNX file of LPIPS, exported as README.md says: held-out views are scored by it")
      ->type_name("FILE");
  app.add_option(
         "--priors-command", server.priors_command,
         "Program that makes masks and depth maps for datasets that have none, as README.md "
         "says; a name without '/' is looked for in PATH")
      ->type_name("PROGRAM");
  app.add_option("--priors-seconds", server.priors_seconds, "Its time limit for one job")
      ->check(CLI::Range(1, 7 * 24 * 3600))
      ->capture_default_str();
  app.add_option("--colmap", server.colmap,
                 "The COLMAP program, which estimates the poses of photographs that come without")
      ->type_name("PROGRAM")
      ->capture_default_str();
  app.add_option("--threads", server.num_threads,
                 "Threads of a job on the CPU; 0: as many as there are cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app.add_option("--device-memory", server.device_memory,
                 "What a training may take of the device; 0: what is free of it now")
      ->transform(CLI::AsSizeValue(/*kb_is_1000=*/false))
      ->capture_default_str();
  app.add_option("--model-memory", server.model_bytes,
                 "Budget for models in the host's memory; 0: half of the machine's")
      ->transform(CLI::AsSizeValue(/*kb_is_1000=*/false))
      ->capture_default_str();
  app.add_option("--device-model-memory", server.model_device_bytes,
                 "The same of the device, where it has its own; 0: half of the device's")
      ->transform(CLI::AsSizeValue(/*kb_is_1000=*/false))
      ->capture_default_str();
  app.add_option("--port-file", flags.port_file, "Where to write the port, once it serves");
  app.add_option("--grace", flags.grace_seconds, "Seconds from SIGTERM until calls are cut off")
      ->check(CLI::Range(0, 3600))
      ->capture_default_str();
  app.add_option("--log-level", flags.log_level, "trace, debug, info, warn, err, critical or off")
      ->check(CLI::IsMember({"trace", "debug", "info", "warn", "err", "critical", "off"}))
      ->capture_default_str();
  app.add_flag("--insecure", server.insecure, "Listen beyond this machine without encryption");
  app.add_flag("--reflection", server.reflection, "Serve gRPC reflection");
}

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

int Serve(const Flags& flags, const sigset_t& stop_signals) {
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
  int signal = 0;
  sigwait(&stop_signals, &signal);
  spdlog::info("signal {}: stopping, within {} s", signal, flags.grace_seconds);
  (*server)->Shutdown(absl::Now() + absl::Seconds(flags.grace_seconds));
  spdlog::info("stopped");
  return EXIT_SUCCESS;
}

}  // namespace

// What is thrown before it serves may end it.  NOLINTNEXTLINE(bugprone-exception-escape)
int main(int argc, char** argv) {
  Flags flags;
  CLI::App app("The pepeseg server: scenes from photographs, segments from clicks", "pepesegd");
  AddFlags(app, flags);
  CLI11_PARSE(app, argc, argv);
  spdlog::set_level(spdlog::level::from_str(flags.log_level));
  const sigset_t stop_signals = BlockStopSignals();
  flags.server.data = std::filesystem::absolute(flags.server.data);
  flags.server.worker = std::filesystem::absolute(flags.server.worker);
  if (!flags.server.lpips_weights.empty()) {
    flags.server.lpips_weights = std::filesystem::absolute(flags.server.lpips_weights);
  }
  // A name without a slash is looked for in PATH.
  if (flags.server.colmap.find('/') != std::string::npos) {
    flags.server.colmap = std::filesystem::absolute(flags.server.colmap).string();
  }
  if (!flags.port_file.empty()) flags.port_file = std::filesystem::absolute(flags.port_file);
  return Serve(flags, stop_signals);
}
