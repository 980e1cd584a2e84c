#include "server/flags.h"

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

namespace pepeseg {
namespace {

// Returns the path of pepeseg-worker in the folder of this program.
std::filesystem::path DefaultWorker() {
  std::error_code error;
  const auto self = std::filesystem::read_symlink("/proc/self/exe", error);
  return error ? "pepeseg-worker" : self.parent_path() / "pepeseg-worker";
}

// Returns the data directory by the XDG base directory specification. Empty: neither XDG_DATA_HOME
// nor HOME is an absolute path.
std::filesystem::path DefaultData() {
  const char* data_home = std::getenv("XDG_DATA_HOME");
  // The specification says to ignore a relative path.
  if (data_home != nullptr && data_home[0] == '/') {
    return std::filesystem::path(data_home) / "pepeseg";
  }
  const char* home = std::getenv("HOME");
  if (home == nullptr || home[0] != '/') return {};
  return std::filesystem::path(home) / ".local" / "share" / "pepeseg";
}

// Returns the folders in which `name`, SAM or the detector, is looked for: where its script of
// deploy/ installs it by default, and where container images and packages have it.
std::vector<std::filesystem::path> DefaultFolders(const std::string& name) {
  std::vector<std::filesystem::path> folders = {std::filesystem::path("/usr/share/pepeseg") / name};
  const std::filesystem::path data = DefaultData();
  if (!data.empty()) folders.insert(folders.begin(), data / name);
  return folders;
}

void AddListenerFlags(CLI::App& app, ServerOptions& server) {
  server.listen = "127.0.0.1:50051";
  app.add_option("--listen", server.listen, "HOST:PORT (port 0: a free one) or unix:PATH")
      ->capture_default_str();
  app.add_option("--admin", server.admin,
                 "HOST:PORT or unix:PATH of the admin service, which loads, unloads and pins "
                 "models; without this flag it is not served");
  app.add_flag("--insecure", server.insecure, "Listen beyond this machine without encryption");
  app.add_flag("--reflection", server.reflection, "Serve gRPC reflection");
  app.add_option_function<int>(
         "--self-probe-seconds",
         [&server](int seconds) { server.self_probe = absl::Seconds(seconds); },
         "Interval at which the server checks its own health over a new connection; after three "
         "failures in a row it ends with exit code 1, to be restarted; 0: never")
      ->check(CLI::Range(0, 3600))
      ->default_str("5");
  app.add_option("--metrics", server.metrics,
                 "HOST:PORT where Prometheus reads metrics, over plain HTTP; without this flag "
                 "they are not served");
}

void AddAccessFlags(CLI::App& app, AccessOptions& access) {
  app.add_option("--tls-certificate", access.tls_certificate,
                 "PEM chain of the server; read again when it changes")
      ->type_name("FILE");
  app.add_option("--tls-key", access.tls_key, "Private key of the certificate, PEM")
      ->type_name("FILE");
  app.add_option("--tls-client-ca", access.tls_client_ca,
                 "PEM bundle: clients must have a certificate that one of these has signed")
      ->type_name("FILE");
  app.add_flag("--require-keys", access.require_keys, "Calls must carry an API key");
  app.add_option("--trusted-gateway", access.trusted_gateway,
                 "Name in the client certificate of a gateway, which states the caller in metadata "
                 "x-pepeseg-... instead of a key; needs --tls-client-ca and --require-keys")
      ->type_name("NAME");
}

void AddStateFlags(CLI::App& app, ServerOptions& server) {
  server.data = DefaultData();
  CLI::Option* data = app.add_option("--data", server.data,
                                     "Data directory; created if it is missing, for its owner "
                                     "only. Default: pepeseg in XDG_DATA_HOME or ~/.local/share");
  // Without a home there is no default, so the flag is required.
  server.data.empty() ? data->required() : data->capture_default_str();
  app.add_option("--database", server.database,
                 "sqlite:PATH or postgresql:CONNINFO. Default: SQLite in the data directory. "
                 "Servers that share a PostgreSQL database must share the data directory, too");
  app.add_option("--lease-seconds", server.launch.lease_seconds,
                 "Lease duration: a server that does not renew its leases for this long loses its "
                 "jobs to another")
      ->check(CLI::Range(2, 3600))
      ->capture_default_str();
}

void AddQuotaFlags(CLI::App& app, Quota& quota) {
  const auto add = [&](const char* name, int64_t& value, const char* what) {
    return app.add_option(name, value, what)->check(CLI::NonNegativeNumber)->capture_default_str();
  };
  const auto add_bytes = [&](const char* name, int64_t& value, const char* what) {
    app.add_option(name, value, what)
        ->transform(CLI::AsSizeValue(/*kb_is_1000=*/false))
        ->capture_default_str();
  };
  add_bytes("--quota-stored-bytes", quota.stored_bytes,
            "Maximum bytes that a project stores: uploaded files, models, selections; 0: no limit");
  add("--quota-open-uploads", quota.open_uploads,
      "Maximum number of a project's uploads that are not sealed; 0: no limit");
  add("--quota-queued-jobs", quota.queued_jobs,
      "Maximum number of a project's jobs in the queue; 0: no limit");
  add("--quota-running-jobs", quota.running_jobs,
      "Maximum number of a project's running jobs; 0: no limit");
  add("--quota-queries", quota.queries_per_second,
      "Maximum number of a project's queries per second; 0: no limit");
  add_bytes("--quota-resident-bytes", quota.resident_bytes,
            "Maximum bytes of a project's models in memory; 0: no limit");
}

void AddWorkerFlags(CLI::App& app, ServerOptions& server) {
  server.worker = DefaultWorker();
  app.add_option("--worker", server.worker, "The pepeseg-worker program")->capture_default_str();
  app.add_option(
         "--devices", server.devices,
         "Devices of jobs and queries, separated by commas: cpu, cuda:N. Each takes one job "
         "at a time. all: every CUDA device, or the CPU if there is none; auto: the first "
         "one, or the CPU. cpu:0,cpu:1: two jobs at a time on the CPU")
      ->capture_default_str();
  app.add_option("--lpips-weights", server.workers.lpips_weights,
                 "ONNX file of LPIPS, exported as in OPERATIONS.md, which scores held-out views")
      ->type_name("FILE");
  app.add_option(
         "--priors-command", server.workers.priors_command,
         "Program that makes masks and depth maps for datasets that have none (README.md); a name "
         "without '/' is looked up in PATH")
      ->type_name("PROGRAM");
  server.default_sam = DefaultFolders("sam");
  app.add_option_function<std::string>(
         "--sam",
         [&server](const std::string& folder) {
           server.default_sam.clear();
           server.workers.sam = folder == "off" ? "" : folder;
         },
         "Folder of a SAM that deploy/sam.sh has installed, which makes masks for datasets that "
         "have "
         "none; off: SAM is not used. Default: sam in the default data directory, or "
         "/usr/share/pepeseg/sam, if there is one")
      ->type_name("FOLDER");
  app.add_option_function<std::string>(
         "--wordnet",
         [&server](const std::string& folder) { server.wordnet = folder == "off" ? "" : folder; },
         "Folder of WordNet's index.noun and data.noun, whose synonyms find labels; off: no "
         "synonyms. Default: /usr/share/wordnet (Debian's wordnet-base), if it is there")
      ->type_name("FOLDER");
  app.add_option("--priors-seconds", server.workers.priors_seconds,
                 "Time limit of the priors command for one job")
      ->check(CLI::Range(1, 7 * 24 * 3600))
      ->capture_default_str();
  app.add_option("--colmap", server.workers.colmap,
                 "The COLMAP program, which estimates the poses of photographs that have none")
      ->type_name("PROGRAM")
      ->capture_default_str();
  const std::map<std::string, bool> on_off = {{"on", true}, {"off", false}};
  app.add_option(
         "--keep-embeddings", server.workers.keep_embeddings,
         "on: what SAM needs of a photograph is kept with the model, 2 MB per photograph, for "
         "requests with sam_borders; off: it is computed when it is needed")
      ->transform(CLI::CheckedTransformer(on_off))
      ->type_name("on|off");
  app.add_option(
         "--sandbox", server.workers.sandbox,
         "on: workers, which read what clients upload, have no network, read only their job's "
         "files and the system's libraries, and write only below their job's folder; off: for a "
         "machine where workers fail with it")
      ->transform(CLI::CheckedTransformer(on_off))
      ->type_name("on|off");
  app.add_option("--sandbox-read", server.workers.sandbox_reads,
                 "File or folder outside /usr that workers and the programs that they run may read "
                 "and execute: the priors command's modules and weights, COLMAP's libraries. May "
                 "be given several times")
      ->type_name("PATH");
  app.add_option("--pass-environment", server.workers.pass_environment,
                 "Variable of the server's environment that workers and the programs that they run "
                 "get in addition to PATH, CUDA_... and similar ones. May be given several times")
      ->type_name("NAME");
  const std::map<std::string, LaunchOptions::Launcher> launchers = {
      {"process", LaunchOptions::Launcher::kProcess}, {"slurm", LaunchOptions::Launcher::kSlurm}};
  app.add_option("--launcher", server.launch.launcher,
                 "process: jobs run on this machine; slurm: on nodes of a Slurm cluster")
      ->transform(CLI::CheckedTransformer(launchers, CLI::ignore_case));
  app.add_option("--checkpoint-seconds", server.launch.checkpoint_seconds,
                 "Maximum time between two checkpoints of a job")
      ->check(CLI::Range(1, 3600))
      ->capture_default_str();
  app.add_option("--slurm-partition", server.launch.slurm_partition,
                 "Slurm partition of the jobs. Default: Slurm's");
  app.add_option("--slurm-gres", server.launch.slurm_gres,
                 "Generic resources of each Slurm job, such as gpu:1");
  app.add_option("--slurm-device", server.launch.slurm_device,
                 "Device of the nodes, as in --devices. Default: the server's");
}

void AddWordFlags(CLI::App& app, ServerOptions& server) {
  server.default_detector = DefaultFolders("detector");
  app.add_option_function<std::string>(
         "--detector",
         [&server](const std::string& folder) {
           server.default_detector.clear();
           server.detector = folder == "off" ? "" : folder;
         },
         "Folder of a detector that deploy/detector.sh has installed, which finds things of 80 "
         "everyday words; off: it is not used. Default: detector in the default data directory, or "
         "/usr/share/pepeseg/detector, if there is one")
      ->type_name("FOLDER");
  app.add_option("--text-command", server.text_command,
                 "Program that finds what a text names in photographs (OPERATIONS.md); a name "
                 "without '/' is looked up in PATH")
      ->type_name("PROGRAM");
  app.add_option("--text-seconds", server.text_seconds,
                 "Time limit of the text command for one text")
      ->check(CLI::Range(1, 3600))
      ->capture_default_str();
}

void AddMemoryFlags(CLI::App& app, ServerOptions& server) {
  app.add_option("--threads", server.num_threads,
                 "CPU threads of a job; 0: the cores, divided among the devices")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app.add_option("--device-memory", server.device_memory,
                 "Maximum memory of a device that a training takes; 0: what is free at the start. "
                 "On the CPU at "
                 "most a worker's limit: what --model-memory and the server's reserve leave")
      ->transform(CLI::AsSizeValue(/*kb_is_1000=*/false))
      ->capture_default_str();
  app.add_option("--model-memory", server.model_bytes,
                 "Budget for models in host memory; 0: half of the memory of the machine or "
                 "container. What it and the server's reserve leave is a worker's limit")
      ->transform(CLI::AsSizeValue(/*kb_is_1000=*/false))
      ->capture_default_str();
  app.add_option("--device-model-memory", server.model_device_bytes,
                 "Budget for models in the memory of a device that has its own; 0: half of it")
      ->transform(CLI::AsSizeValue(/*kb_is_1000=*/false))
      ->capture_default_str();
}

void AddDrainFlag(CLI::App& app, ServerOptions& server) {
  app.add_option_function<int>(
         "--drain-seconds", [&server](int seconds) { server.drain = absl::Seconds(seconds); },
         "Time from SIGTERM, during which health reports NOT_SERVING, until calls are refused, so "
         "that a gateway can see it; --grace counts from then")
      ->check(CLI::Range(0, 3600))
      ->default_str("0");
}

}  // namespace

void AddFlags(CLI::App& app, Flags& flags) {
  AddListenerFlags(app, flags.server);
  AddAccessFlags(app, flags.server.access);
  AddStateFlags(app, flags.server);
  AddQuotaFlags(app, flags.server.quota);
  AddWorkerFlags(app, flags.server);
  AddWordFlags(app, flags.server);
  AddMemoryFlags(app, flags.server);
  app.add_option("--port-file", flags.port_file,
                 "File to which the port is written once the server listens");
  app.add_option(
         "--grace", flags.grace_seconds,
         "Maximum seconds from SIGTERM to the end of the process, in addition to --drain-seconds. "
         "Calls are cut off a tenth of it earlier, at most 1 s")
      ->check(CLI::Range(0, 3600))
      ->capture_default_str();
  AddDrainFlag(app, flags.server);
  app.add_option("--log-level", flags.log_level, "trace, debug, info, warn, err, critical or off")
      ->check(CLI::IsMember({"trace", "debug", "info", "warn", "err", "critical", "off"}))
      ->capture_default_str();
  app.add_option(
         "--log-format", flags.server.workers.log_format,
         "Format of the server's and the workers' logs: text, or json (one object per line)")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
}

void MakePathsAbsolute(Flags& flags) {
  ServerOptions& server = flags.server;
  for (std::filesystem::path* path :
       {&server.data, &server.worker, &server.workers.lpips_weights, &server.workers.sam,
        &server.detector, &server.wordnet, &server.access.tls_certificate, &server.access.tls_key,
        &server.access.tls_client_ca, &flags.port_file}) {
    if (!path->empty()) *path = std::filesystem::absolute(*path);
  }
  for (std::string& path : server.workers.sandbox_reads) {
    path = std::filesystem::absolute(path).string();
  }
  // A name without a slash is looked up in PATH.
  if (server.workers.colmap.find('/') != std::string::npos) {
    server.workers.colmap = std::filesystem::absolute(server.workers.colmap).string();
  }
}

}  // namespace pepeseg
