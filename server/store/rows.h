#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "server/store/quota.h"

// What the store keeps, as plain values. `scene` is a scene's key in all of them. Resource names
// are built from these at the RPC edge: scenes/{scene}, scenes/{scene}/datasets/{number},
// scenes/{scene}/models/{number}, scenes/{scene}/labels/{id}, scenes/{scene}/selections/{number},
// jobs/{id}, keys/{id}.
namespace pepeseg {

// Of whoever needs no key, and of what stood before there were projects.
inline constexpr char kDefaultProject[] = "default";

struct ProjectRow {
  std::string id;  // RFC 1034 label
  Quota quota;     // 0: the server's default
  absl::Time create_time;
};

// Without its secret, which nobody keeps.
struct KeyRow {
  std::string id;  // 16 hex digits
  std::string project;
  std::string display_name;
  std::string sha256;  // of the secret, 64 hex digits, lower case
  int scopes = 0;      // bit N: pepeseg.v1.Scope N
  absl::Time create_time;
  absl::Time expire_time = absl::InfinitePast();  // InfinitePast: never
  absl::Time revoke_time = absl::InfinitePast();  // InfinitePast: it is not
};

struct SceneRow {
  std::string id;  // IsResourceId; unique within its project
  std::string display_name;
  std::string request_id;  // of the create call; empty: none
  absl::Time create_time;
  std::string project = kDefaultProject;
  std::string key = {};  // what other rows call it, and the store's calls: server/store/scene_key.h
};

enum class DatasetState { kOpen = 0, kSealed = 1 };  // numbers are stored: never renumber

// Open: an upload in progress. Sealed: immutable, can be trained on.
struct DatasetRow {
  std::string scene;
  int64_t number = 0;  // from 1, never reused
  DatasetState state = DatasetState::kOpen;
  std::string request_id;
  absl::Time create_time;
  absl::Time seal_time;  // InfinitePast while open
  int64_t num_files = 0;
  int64_t num_bytes = 0;  // declared sizes
};

// Whether a stored file's header has been read. kRefused: it is not the header of such a file; a
// training names the error. Numbers are stored: never renumber.
enum class HeaderState { kUnread = 0, kRead = 1, kRefused = 2 };

struct DatasetFileRow {
  std::string path;  // the client's name for it: metadata, never opened
  int kind = 0;      // pepeseg.v1.FileKind
  int64_t size = 0;
  std::string sha256;   // 64 hex digits, lower case
  bool stored = false;  // the project has the bytes
  // What the header says once it is kRead; see ReadHeader in server/services/file_header.h.
  HeaderState header = HeaderState::kUnread;
  int width = 0, height = 0;  // of a photograph as stored, before EXIF turns it, pixels
  int64_t num_points = 0;     // points or Gaussians in the file; of COLMAP's text form an estimate
};

enum class JobState { kQueued = 0, kRunning = 1, kSucceeded = 2, kFailed = 3, kCancelled = 4 };

// How an attempt ended whose job is to be tried again.
enum class AttemptEnd {
  kStopped,      // as it was asked to, or because its server could not reach the database
  kServerEnded,  // with its server
  kCrashed,      // its worker ended without a result
};

struct EndedAttempt {
  AttemptEnd end = AttemptEnd::kStopped;
  bool progress = false;   // it left something that the next attempt resumes from
  absl::Duration pause{};  // before the next attempt
};

// Terminal: never changes again.
inline bool IsTerminal(JobState state) {
  return state != JobState::kQueued && state != JobState::kRunning;
}

struct JobRow {
  std::string id;      // "j" and the number
  int64_t number = 0;  // from 1, in order of creation
  std::string scene;
  int64_t dataset = 0;  // number of a sealed dataset of the scene
  JobState state = JobState::kQueued;
  std::string stage;              // "prepare", "reconstruct", ...; empty before the first
  std::string device;             // Backend::name(), of the newest attempt; empty before
  std::string options;            // serialised pepeseg.v1.TrainingOptions as asked for
  std::string effective_options;  // likewise, every field filled in
  std::string request_id;
  int64_t fence = 0;  // attempt: rises by one with each claim
  // Of a RUNNING job. The owner is a server's name for itself; from lease_end (of the database's
  // clock; InfiniteFuture: never) on another may claim the job.
  std::string lease_owner;
  absl::Time lease_end;
  std::string launch;  // what the launcher calls it, as "slurm:17"; empty: the server's own process
  // Attempts in a row without progress, by how they ended: see AttemptEnd.
  int crashes = 0, server_ends = 0;
  absl::Time not_before;  // of a QUEUED job: claimed no sooner, by the database's clock
  // Estimated when it was queued: host memory in bytes, time in seconds; 0: not known.
  int64_t host_bytes = 0, seconds = 0;
  bool cancel_requested = false;
  int error_code = 0;  // absl::StatusCode, of a FAILED job
  std::string error_message;
  int64_t model = 0;  // number of the model that it made; 0: none
  absl::Time create_time;
  absl::Time start_time;    // of the newest attempt; InfinitePast before
  absl::Time end_time;      // InfinitePast before
  std::string traceparent;  // W3C, of the call that made it; empty in old rows
};

// The immutable result of a job; the one with the highest number is the scene's live model.
struct ModelRow {
  std::string scene;
  int64_t number = 0;  // from 1, never reused
  std::string job;
  int64_t dataset = 0;  // number of the dataset that the job was trained on; 0: not known
  std::string device;   // JobRow's, of the attempt that made it
  std::string folder;   // below the data directory: for core/model_files/model_file.h
  std::string metrics;  // JSON object of numbers: Model::metrics
  std::string sources;  // JSON object of texts: JobResult::sources; empty in old rows
  int64_t num_gaussians = 0;
  int64_t num_bytes = 0;  // on disk
  absl::Time create_time;
};

// A name for what a mask of a view shows.
struct LabelRow {
  std::string scene;
  std::string id;    // IsResourceId
  std::string text;  // UTF-8
  std::string view;
  int width = 0, height = 0;  // of the view and the mask, pixels
  std::string counts;         // of the mask: COCO's compressed run lengths
  int64_t area = 0;           // pixels in the mask
  std::string request_id;
  absl::Time create_time;
};

// Gaussians of a model.
struct SelectionRow {
  std::string scene;
  int64_t number = 0;                  // from 1, never reused
  int64_t model = 0;                   // number of the model that it is of
  int64_t model_gaussians = 0;         // that the model has
  int64_t num_gaussians = 0;           // that are selected
  std::array<double, 3> min{}, max{};  // of their means, scene units; zeros when there are none
  int64_t base = 0;                    // number of the selection that it was made from; 0: none
  std::string file;       // below the data directory: for core/model_files/selection_file.h
  int64_t num_bytes = 0;  // of that file
  std::string request_id;
  std::string request_digest;  // of what was asked for with the request_id
  absl::Time create_time;
};

struct PageRequest {
  int page_size = 0;       // 0: 50; at most 1000
  std::string page_token;  // empty: the first page
};

template <typename Row>
struct Page {
  std::vector<Row> rows;
  std::string next_page_token;  // empty: that was the last
};

}  // namespace pepeseg
