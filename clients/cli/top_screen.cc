#include "clients/cli/top_screen.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/byte_units.h"
#include "clients/cli/progress_line.h"

namespace pepeseg::client::cli {
namespace {

constexpr size_t kColumns = 120;

double Mib(int64_t bytes) { return static_cast<double>(bytes) / (1 << 20); }
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
  return absl::StrFormat("%.1f questions/s, p50 %.1f ms, p99 %.1f ms", status.queries_per_second(),
                         Milliseconds(status.query_p50()), Milliseconds(status.query_p99()));
}

std::string PoolLine(const v1::ServerStatus::Pool& pool) {
  return absl::StrFormat("%-10s  %d of %d busy, %d of %d queued", pool.name(), pool.num_busy(),
                         pool.num_threads(), pool.num_queued(), pool.max_queued());
}

std::string RunningLine(const v1::Job& job) {
  const std::string what = job.has_progress()    ? ProgressText(job.progress(), kColumns)
                           : job.stage().empty() ? "begins"
                                                 : job.stage();
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

}  // namespace

std::vector<std::string> TopLines(const TopSnapshot& snapshot, absl::Time now) {
  const v1::ServerStatus& status = snapshot.status;
  const v1::ListResidentResponse& resident = snapshot.resident;
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

}  // namespace pepeseg::client::cli
