// The verbs about the state of a server: "top", which shows again and again what it is doing,
// "drain", and "health", which asks the standard service grpc.health.v1, as gateways and
// orchestrators do.
#include "clients/cli/server_state.h"

#include <google/protobuf/wrappers.pb.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/support/byte_buffer.h>
#include <unistd.h>

#include <chrono>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "clients/cli/admin_verb.h"
#include "clients/cli/verbs.h"
#include "clients/cpp/answer_status.h"
#include "clients/cpp/call.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/progress_line.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/text_table.h"
#include "pepeseg/v1/admin_service.grpc.pb.h"

namespace pepeseg::client::cli {
namespace {

constexpr size_t kColumns = 120;  // of the progress of a job

double Gib(int64_t bytes) { return static_cast<double>(bytes) / (1 << 30); }

double Milliseconds(const google::protobuf::Duration& duration) {
  return static_cast<double>(duration.seconds()) * 1e3 + duration.nanos() * 1e-6;
}

std::string ServerLine(const v1::ServerStatus& status, absl::Time now) {
  const absl::Duration up = now - absl::FromUnixSeconds(status.start_time().seconds());
  return absl::StrFormat("pepesegd %s on %s, up %s%s", status.version(), status.device(),
                         ClockText(absl::ToDoubleSeconds(up)),
                         status.draining() ? ", DRAINING" : "");
}

std::string ProcessLine(const v1::ServerStatus& status) {
  return absl::StrFormat("%.1f MiB, %d threads, %d descriptors, %d streams, %.1f GiB of disk free",
                         Mib(status.resident_bytes()), status.num_threads(),
                         status.num_descriptors(), status.num_streams(),
                         Gib(status.disk_free_bytes()));
}

// Returns a line of one of several devices: its job, and the models in its memory.
std::string DeviceLine(const v1::ServerStatus::Device& device) {
  return absl::StrFormat("%-8s %s; models in memory: %d, %.1f of %.1f GiB", device.id(),
                         device.job().empty() ? "no job" : device.job(), device.num_models(),
                         Gib(device.model_bytes()), Gib(device.model_limit_bytes()));
}

std::string QueryLine(const v1::ServerStatus& status) {
  return absl::StrFormat("%.1f queries/s, p50 %.1f ms, p99 %.1f ms", status.queries_per_second(),
                         Milliseconds(status.query_p50()), Milliseconds(status.query_p99()));
}

std::string PoolLine(const v1::ServerStatus::Pool& pool) {
  return absl::StrFormat("%-10s  %d of %d busy, %d of %d queued", WordOf(pool.work()),
                         pool.num_busy(), pool.num_threads(), pool.num_queued(), pool.max_queued());
}

std::string FindLine(const v1::ServerStatus::FindSources& sources) {
  std::vector<std::string> by = {"labels"};
  if (sources.synonyms()) by.emplace_back("their synonyms");
  if (sources.num_detector_words() > 0) {
    by.push_back(absl::StrCat("a detector of ", sources.num_detector_words(), " words"));
  }
  if (sources.text_command()) by.emplace_back("the text command");
  if (sources.appearance()) by.emplace_back("looks");
  return absl::StrCat("finds by ", absl::StrJoin(by, ", "));
}

std::string RunningLine(const v1::Job& job) {
  const std::string stage = WordOf(job.stage());
  const std::string what = job.has_progress() ? ProgressText(job.progress(), kColumns)
                           : stage.empty()    ? "starting"
                                              : stage;
  return absl::StrFormat("%-10s  %-24s  %s", job.name(), job.scene(), what);
}

std::string ResidentLine(const v1::ResidentModel& model) {
  return absl::StrFormat("%-32s  %8.1f + %8.1f MiB  %d maps, %d in flight%s", model.name(),
                         Mib(model.host_bytes()), Mib(model.device_bytes()), model.cached_maps(),
                         model.queries_in_flight(), model.pinned() ? ", pinned" : "");
}

std::string UseText(const v1::MemoryUse& use) {
  return absl::StrFormat("%.1f of %.1f MiB", Mib(use.reserved_bytes()), Mib(use.limit_bytes()));
}

constexpr auto kPace = std::chrono::seconds(2);
constexpr double kTopSeconds = 10;  // deadline of a call

struct TopFlags {
  std::string admin;
  bool once = false;
};

// Asks the server for its status and its models in memory.
absl::StatusOr<TopSnapshot> TakeSnapshot(v1::AdminService::Stub& admin) {
  TopSnapshot snapshot;
  Call status("", kTopSeconds);
  RETURN_IF_ERROR(FromGrpc(admin.GetServerStatus(status, {}, &snapshot.status)));
  Call resident("", kTopSeconds);
  RETURN_IF_ERROR(FromGrpc(admin.ListResidentModels(resident, {}, &snapshot.resident)));
  return snapshot;
}

// Prints the snapshot: as JSON on one line, or as a screen, which replaces the one before it on a
// terminal.
void Show(const Shell& shell, const TopSnapshot& snapshot) {
  if (shell.json) {
    Print(absl::StrCat("{\"status\":", ToJson(snapshot.status),
                       ",\"resident\":", ToJson(snapshot.resident), "}"));
    return;
  }
  constexpr char kClear[] = "\x1b[H\x1b[2J";  // cursor to the top left, erase the screen
  std::string screen = isatty(STDOUT_FILENO) == 1 ? kClear : "";
  for (const std::string& line : TopLines(snapshot, absl::Now())) {
    absl::StrAppend(&screen, line, "\n");
  }
  Print(screen.substr(0, screen.size() - 1));
}

// Shows snapshots until it is interrupted or a call fails.
absl::Status RunTop(const Shell& shell, const TopFlags& flags, v1::AdminService::Stub& admin) {
  while (true) {
    ASSIGN_OR_RETURN(const TopSnapshot snapshot, TakeSnapshot(admin));
    Show(shell, snapshot);
    if (flags.once) return absl::OkStatus();
    std::this_thread::sleep_for(kPace);
  }
}

struct DrainFlags {
  std::string admin;
  bool off = false;
};

// Drains the server, or with --off ends the drain, and prints its new state.
absl::Status RunDrain(const Shell& shell, const DrainFlags& flags, v1::AdminService::Stub& admin) {
  TopSnapshot snapshot;
  Call call("", kTopSeconds);
  RETURN_IF_ERROR(FromGrpc(flags.off ? admin.ResumeServer(call, {}, &snapshot.status)
                                     : admin.DrainServer(call, {}, &snapshot.status)));
  shell.json ? PrintJson(snapshot.status) : Print(TopLines(snapshot, absl::Now()).front());
  return absl::OkStatus();
}

constexpr double kHealthSeconds = 5;  // deadline of the call
constexpr int kServing = 1;           // HealthCheckResponse.ServingStatus.SERVING

// Returns the ServingStatus of a service, or of the whole server for "".
//
// Debian has no stubs of the health service, so the call is generic. On the wire HealthCheckRequest
// is a StringValue and HealthCheckResponse an Int32Value: each has one field, number 1.
absl::StatusOr<int> AskHealth(const Shell& shell, const std::string& service) {
  google::protobuf::StringValue message;
  message.set_value(service);
  const grpc::Slice bytes(message.SerializeAsString());
  const grpc::ByteBuffer request(&bytes, 1);
  grpc::ByteBuffer response;
  Call call("", kHealthSeconds);
  grpc::GenericStub stub(shell.channel);
  std::promise<grpc::Status> done;
  stub.UnaryCall(call, "/grpc.health.v1.Health/Check", grpc::StubOptions(), &request, &response,
                 [&done](grpc::Status status) { done.set_value(std::move(status)); });
  RETURN_IF_ERROR(FromGrpc(done.get_future().get()));
  grpc::Slice answer;
  google::protobuf::Int32Value status;
  if (!response.DumpToSingleSlice(&answer).ok() ||
      !status.ParseFromArray(answer.begin(), static_cast<int>(answer.size()))) {
    return absl::InternalError("the server's answer is not one of grpc.health.v1");
  }
  return status.value();
}

// `alive`: any answer is a success, whatever its status.
absl::Status RunHealth(const Shell& shell, const std::string& service, bool alive) {
  ASSIGN_OR_RETURN(const int status, AskHealth(shell, service));
  const std::string name = service.empty() ? "the server" : service;
  if (alive) {
    const char* answer = status == kServing ? "true" : "false";
    Print(shell.json ? absl::StrCat(R"({"serving":)", answer, "}")
                     : absl::StrCat(name, " answers"));
    return absl::OkStatus();
  }
  if (status != kServing) {
    return absl::UnavailableError(absl::StrCat(name,
                                               " does not serve: it is shutting down or drained, "
                                               "or something that it depends on has failed"));
  }
  Print(shell.json ? R"({"serving":true})" : absl::StrCat(name, " serves"));
  return absl::OkStatus();
}

}  // namespace

std::vector<std::string> TopLines(const TopSnapshot& snapshot, absl::Time now) {
  const v1::ServerStatus& status = snapshot.status;
  const v1::ListResidentModelsResponse& resident = snapshot.resident;
  std::vector<std::string> lines = {ServerLine(status, now), ProcessLine(status), QueryLine(status),
                                    ""};
  if (status.devices_size() > 1) {
    for (const v1::ServerStatus::Device& device : status.devices()) {
      lines.push_back(DeviceLine(device));
    }
    lines.push_back("");
  }
  for (const v1::ServerStatus::Pool& pool : status.pools()) lines.push_back(PoolLine(pool));
  lines.push_back("");
  lines.push_back(FindLine(status.find_sources()));
  lines.push_back("");
  lines.push_back(absl::StrCat("jobs: ", status.running_jobs_size(), " running, ",
                               status.num_queued_jobs(), " queued"));
  for (const v1::Job& job : status.running_jobs()) lines.push_back(RunningLine(job));
  lines.push_back("");
  lines.push_back(absl::StrCat(
      "models in memory: ", resident.models_size(), "; host ", UseText(resident.host()),
      resident.has_device() ? absl::StrCat("; device ", UseText(resident.device())) : ""));
  for (const v1::ResidentModel& model : resident.models()) lines.push_back(ResidentLine(model));
  return lines;
}

void AddTop(CLI::App& app, Shell& shell) {
  const auto flags = std::make_shared<TopFlags>();
  AddAdminVerb<TopFlags>(app, shell, {"top", "Show what a server is doing, every two seconds"},
                         {flags, RunTop})
      .add_flag("--once", flags->once, "Show it once and exit");
}

void AddDrain(CLI::App& app, Shell& shell) {
  const auto flags = std::make_shared<DrainFlags>();
  AddAdminVerb<DrainFlags>(
      app, shell, {"drain", "Let a server accept no new calls and jobs, before it is stopped"},
      {flags, RunDrain})
      .add_flag("--off", flags->off, "Let it accept calls and jobs again");
}

void AddHealth(CLI::App& app, Shell& shell) {
  const auto service = std::make_shared<std::string>();
  CLI::App* verb =
      app.add_subcommand("health", "Check that the server serves; exit code 5 if it does not");
  verb->add_option("SERVICE", *service,
                   "A service, such as pepeseg.v1.JobService; by default the whole server");
  const auto alive = std::make_shared<bool>(false);
  verb->add_flag(
      "--alive", *alive,
      "Check only that the server answers, whether it serves or not; for liveness probes");
  verb->callback([service, alive, &shell] {
    shell.verb = [service, alive, &shell] { return RunHealth(shell, *service, *alive); };
  });
}

}  // namespace pepeseg::client::cli
