// The verbs "top", which shows again and again what a server is doing, and "drain".
#include "clients/cli/top.h"

#include <unistd.h>

#include <chrono>
#include <memory>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "clients/cli/admin_verb.h"
#include "clients/cli/enum_words.h"
#include "clients/cli/progress_line.h"
#include "clients/cli/shell.h"
#include "clients/cli/text_table.h"
#include "clients/cpp/answer_status.h"
#include "clients/cpp/call.h"
#include "clients/cpp/status_macros.h"
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

std::string QueryLine(const v1::ServerStatus& status) {
  return absl::StrFormat("%.1f queries/s, p50 %.1f ms, p99 %.1f ms", status.queries_per_second(),
                         Milliseconds(status.query_p50()), Milliseconds(status.query_p99()));
}

std::string PoolLine(const v1::ServerStatus::Pool& pool) {
  return absl::StrFormat("%-10s  %d of %d busy, %d of %d queued", WordOf(pool.work()),
                         pool.num_busy(), pool.num_threads(), pool.num_queued(), pool.max_queued());
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

}  // namespace

std::vector<std::string> TopLines(const TopSnapshot& snapshot, absl::Time now) {
  const v1::ServerStatus& status = snapshot.status;
  const v1::ListResidentModelsResponse& resident = snapshot.resident;
  std::vector<std::string> lines = {ServerLine(status, now), ProcessLine(status), QueryLine(status),
                                    ""};
  for (const v1::ServerStatus::Pool& pool : status.pools()) lines.push_back(PoolLine(pool));
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

}  // namespace pepeseg::client::cli
