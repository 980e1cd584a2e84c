#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "server/store/quota.h"
#include "server/store/scene_ref.h"

// The store's records as plain values. server/api builds resource names from them: scenes/{scene},
// scenes/{scene}/datasets/{number}, scenes/{scene}/models/{number}, scenes/{scene}/labels/{id},
// scenes/{scene}/selections/{number}, jobs/{id}, keys/{id}.
namespace pepeseg {

// The project of callers on a server without keys.
inline constexpr char kDefaultProject[] = "default";

struct ProjectRecord {
  std::string id;  // RFC 1034 label
  Quota quota;     // fields that are 0: the server's default
  absl::Time create_time;
};

// An API key without its secret, which is not stored anywhere.
struct KeyRecord {
  std::string id;  // 16 hex digits
  std::string project;
  std::string display_name;
  std::string sha256;  // of the secret, 64 hex digits, lower case
  int scopes = 0;      // bit N: pepeseg.v1.Scope N
  absl::Time create_time;
  absl::Time expire_time = absl::InfinitePast();  // InfinitePast: never
  absl::Time revoke_time = absl::InfinitePast();  // InfinitePast: not revoked
};

struct SceneRecord {
  SceneRef scene;
  std::string display_name;
  std::string request_id;  // of the create call; empty: none
  absl::Time create_time;
};

enum class DatasetState { kOpen = 0, kSealed = 1 };  // numbers are stored: never renumber

// A set of files. Open: an upload in progress. Sealed: immutable, can be trained on.
struct DatasetRecord {
  SceneRef scene;
  int64_t number = 0;  // from 1, never reused
  DatasetState state = DatasetState::kOpen;
  std::string request_id;
  absl::Time create_time;
  absl::Time seal_time;  // InfinitePast while open
  int64_t num_files = 0;
  int64_t num_bytes = 0;  // sum of the declared sizes
};

// Whether a stored file's header has been read. kRefused: it is not the header of a file of this
// kind; a training reports the error. Numbers are stored: never renumber.
enum class HeaderState { kUnread = 0, kRead = 1, kRefused = 2 };

struct DatasetFileRecord {
  std::string path;  // chosen by the client: metadata, never opened
  int kind = 0;      // pepeseg.v1.FileKind
  int64_t size = 0;
  std::string sha256;   // 64 hex digits, lower case
  bool stored = false;  // the project has the bytes
  // Facts from the header, valid if it is kRead; see FileFacts.
  HeaderState header = HeaderState::kUnread;
  int width = 0, height = 0;  // of a photograph as stored, before EXIF turns it, pixels
  int64_t num_points = 0;     // points or Gaussians in the file; estimated for COLMAP's text format
};

enum class JobState { kQueued = 0, kRunning = 1, kSucceeded = 2, kFailed = 3, kCancelled = 4 };

// How an attempt ended, if its job is to be tried again.
enum class AttemptEnd {
  kStopped,      // on request, or because its server could not reach the database
  kServerEnded,  // together with its server
  kCrashed,      // the worker ended without a result
  kPutBack,      // its device was needed for a preview
};

struct EndedAttempt {
  AttemptEnd end = AttemptEnd::kStopped;
  bool progress = false;   // the attempt left something that the next one resumes from
  absl::Duration pause{};  // before the next attempt
};

// Returns whether a job in this state never changes again.
inline bool IsTerminal(JobState state) {
  return state != JobState::kQueued && state != JobState::kRunning;
}

struct JobRecord {
  std::string id;      // "j" and the number
  int64_t number = 0;  // from 1, in order of creation
  SceneRef scene;
  int64_t dataset = 0;  // number of a sealed dataset of the scene
  JobState state = JobState::kQueued;
  std::string stage;              // "prepare", "reconstruct", ...; empty before the first
  std::string device;             // Backend::name() in the newest attempt; empty before the first
  std::string options;            // serialised pepeseg.v1.TrainingOptions as requested
  std::string effective_options;  // serialised pepeseg.v1.TrainingOptions with every field set
  std::string request_id;
  bool preview = false;  // of the preset PREVIEW, which is claimed before others
  int64_t fence = 0;     // number of the attempt: rises by one with each
  // Name of the server that holds a RUNNING job; Store::Holder::name.
  std::string lease_owner;
  // When another server may claim the job, by the database's clock. InfiniteFuture: never.
  absl::Time lease_end;
  std::string launch;  // the launcher's name for a worker, as "slurm:17"; empty: a child process
  // Attempts in a row without progress, by how they ended: see AttemptEnd.
  int crashes = 0, server_ends = 0;
  int put_backs = 0;      // attempts that ended as AttemptEnd::kPutBack
  absl::Time not_before;  // earliest claim of a QUEUED job, by the database's clock
  // Estimates from when the job was queued: host memory in bytes, time in seconds. 0: not known.
  int64_t host_bytes = 0, seconds = 0;
  bool cancel_requested = false;
  int error_code = 0;  // absl::StatusCode of a FAILED or CANCELLED job
  std::string error_message;
  int64_t model = 0;  // number of the model that the job made; 0: none
  absl::Time create_time;
  absl::Time start_time;    // of the newest attempt; InfinitePast before the first
  absl::Time end_time;      // InfinitePast until the job has ended
  std::string traceparent;  // W3C trace of the call that created it; empty in old records
};

// The immutable result of a job, of a correction or of an edit. The scene's live model is the
// newest one, or the one that ModelStore::SetLiveModel has named since.
struct ModelRecord {
  SceneRef scene;
  int64_t number = 0;  // from 1, never reused
  std::string job;
  int64_t dataset = 0;  // number of the dataset that it was trained on; 0: not known
  std::string device;   // JobRecord::device of the attempt that made it
  std::string folder;   // path below the data directory; see core/model_files/model_file.h
  std::string metrics;  // JSON object of numbers: Model::metrics
  std::string sources;  // JSON object of strings: JobResult::sources; empty in old records
  int64_t num_gaussians = 0;
  int64_t num_bytes = 0;  // on disk
  int64_t made_from = 0;  // number of the model that was corrected or edited to make it; 0: none
  std::string edit;       // what the edit did, for people; empty: no edit made it
  absl::Time create_time;
};

// A name for the object that a mask of a view shows.
struct LabelRecord {
  SceneRef scene;
  std::string id;    // IsResourceId
  std::string text;  // UTF-8
  std::string view;
  int width = 0, height = 0;  // of the view and the mask, pixels
  std::string counts;         // the mask in COCO's compressed run lengths
  int64_t area = 0;           // pixels in the mask
  std::string request_id;
  absl::Time create_time;
};

// A subset of a model's Gaussians.
struct SelectionRecord {
  SceneRef scene;
  int64_t number = 0;                  // from 1, never reused
  int64_t model = 0;                   // number of the model
  int64_t model_gaussians = 0;         // number of Gaussians in the model
  int64_t num_gaussians = 0;           // number of selected Gaussians
  std::array<double, 3> min{}, max{};  // bounds of their means, scene units; 0 if none is selected
  int64_t base = 0;                    // number of the selection that it was made from; 0: none
  std::string display_name;            // UTF-8
  std::string file;       // path below the data directory; see core/model_files/model_file.h
  int64_t num_bytes = 0;  // size of that file
  std::string request_id;
  std::string request_digest;  // of the request that carried the request_id
  absl::Time create_time;
};

struct PageRequest {
  int page_size = 0;       // records per page, at most 1000; 0: 50
  std::string page_token;  // Page::next_page_token of the page before; empty: the first page
};

template <typename Record>
struct Page {
  std::vector<Record> records;
  std::string next_page_token;  // empty: this is the last page
};

}  // namespace pepeseg
