#pragma once

#include <google/protobuf/timestamp.pb.h>

#include <cstdint>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "pepeseg/v1/access.pb.h"
#include "pepeseg/v1/job_service.pb.h"
#include "pepeseg/v1/segmentation_service.pb.h"
#include "pepeseg/v1/server_status.pb.h"

// Tables, and times, sizes and enum values as their cells show them.
namespace pepeseg::client::cli {

using TableRow = std::vector<std::string>;

// Returns the lines of a table whose first row is the header. Each column is as wide as its widest
// cell.
std::vector<std::string> TextTable(const std::vector<TableRow>& rows);

absl::Time ToTime(const google::protobuf::Timestamp& time);
// Returns "40 s", "5 min", "3 h" or "12 days": rounded down to the largest unit, at least 0 s.
std::string SpanText(absl::Duration span);
// Returns the SpanText since `time` of the server's clock; 0 s if that clock is ahead of ours.
std::string AgeText(const google::protobuf::Timestamp& time, absl::Time now);
// Returns "840 kB", "12.3 MB" or "1.2 GB".
std::string SizeText(int64_t bytes);
// Converts bytes to MiB.
inline double Mib(int64_t num_bytes) { return static_cast<double>(num_bytes) / (1 << 20); }

// Returns what a queued job waits for: "after 2 others, when a device is free", "until another job
// of its project ends, by its quota", "12 s until the next attempt". Empty: it is not known.
std::string WaitText(const v1::Job::Wait& wait, absl::Time now);

// Each returns the name of a value in lower case and without the prefix of its type: "reconstruct"
// for JOB_STAGE_RECONSTRUCT. Returns "" for UNSPECIFIED, and the number of a value that this
// program does not know, which a newer server sends.
std::string WordOf(v1::JobState state);
std::string WordOf(v1::JobStage stage);
std::string WordOf(v1::JobEvent::TermSkipped::Term term);
std::string WordOf(v1::ProposeScalesResponse::Kind kind);
std::string WordOf(v1::Scope scope);
std::string WordOf(v1::ServerStatus::Work work);

}  // namespace pepeseg::client::cli
