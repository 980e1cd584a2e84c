#include "server/collect/collection.h"

#include <algorithm>
#include <set>
#include <string>
#include <system_error>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "core/base/status_macros.h"
#include "server/data/locked_file.h"
#include "server/store/layout.h"
#include "server/worker_protocol/beneath_folder.h"

namespace pepeseg {

namespace fs = std::filesystem;

namespace {

constexpr size_t kDigestLength = 64;

bool IsDigest(const fs::path& file) { return file.filename().string().size() == kDigestLength; }

// Returns the upload whose partial files are in a folder "SCENE-N"; its number is 0 if the folder
// has no such name.
UploadName UploadOf(const fs::path& folder) {
  const std::string name = folder.filename().string();
  const size_t hyphen = name.rfind('-');
  UploadName upload;
  upload.scene.project = folder.parent_path().filename().string();
  if (hyphen == std::string::npos || !absl::SimpleAtoi(name.substr(hyphen + 1), &upload.number)) {
    upload.number = 0;
    return upload;
  }
  if (!absl::SimpleAtoi(name.substr(0, hyphen), &upload.scene.id)) upload.number = 0;
  return upload;
}

// Returns the time since the upload was created, or since bytes of one of its files came last.
absl::StatusOr<absl::Duration> SinceLastWrite(const Collection& collection,
                                              const DatasetRecord& record, const UploadName& name) {
  const fs::path& data = collection.options.data;
  absl::Duration since = absl::Now() - record.create_time;
  for (const fs::path& file : EntriesOf(PartialFolderOf(data, name))) {
    since = std::min(since, AgeOf(file));
  }
  ASSIGN_OR_RETURN(const auto files,
                   collection.store.files().ListDatasetFiles(record.scene, record.number));
  for (const DatasetFileRecord& file : files) {
    // A complete file has left the upload's folder; its blob has the time of its last write.
    // Another upload may have brought it, which only makes this one look younger.
    const fs::path blob = BlobPath(data, {name.scene.project, file.sha256});
    std::error_code error;
    if (fs::exists(blob, error)) since = std::min(since, AgeOf(blob));
  }
  return since;
}

// Removes an upload's partial files, except those that are being written. Returns whether all are
// gone.
bool RemovePartialFiles(Collection& collection, const fs::path& folder) {
  bool all = true;
  for (const fs::path& file : EntriesOf(folder)) {
    if (!IsDigest(file)) continue;
    const absl::StatusOr<LockedFile> locked = LockedFile::TryAlone(file);
    // Removed under the lock, so that no stream opens the file in between and writes to a file
    // without a name.
    if (locked.ok()) {
      collection.Remove(LengthPath(file));
      collection.Remove(file);
    } else {
      all = false;
    }
  }
  if (!all) return false;
  for (const fs::path& file : EntriesOf(folder)) {
    if (!IsDigest(file)) collection.Remove(file);  // the length of a file that was completed
  }
  std::error_code ignored;
  fs::remove(folder, ignored);
  return true;
}

bool IsBeingWritten(const fs::path& folder) {
  const std::vector<fs::path> files = EntriesOf(folder);
  return std::any_of(files.begin(), files.end(), [](const fs::path& file) {
    return IsDigest(file) && !LockedFile::TryAlone(file).ok();
  });
}

// Deletes an upload if it is old enough and nothing of it is being written.
absl::Status CollectUpload(Collection& collection, const DatasetRecord& record) {
  const UploadName name{record.scene, record.number};
  ASSIGN_OR_RETURN(const absl::Duration since, SinceLastWrite(collection, record, name));
  const fs::path folder = PartialFolderOf(collection.options.data, name);
  if (since < collection.options.upload_age || IsBeingWritten(folder)) return absl::OkStatus();
  // The record first: a stream that starts now finds no upload.
  const absl::Status deleted =
      collection.store.datasets().DeleteUpload(record.scene, record.number);
  // It was sealed, or deleted with its scene, meanwhile.
  if (absl::IsFailedPrecondition(deleted) || absl::IsNotFound(deleted)) return absl::OkStatus();
  RETURN_IF_ERROR(deleted);
  ++collection.collected.num_uploads;
  RemovePartialFiles(collection, folder);
  return absl::OkStatus();
}

// Returns whether the upload is open and of the project that its folder names.
absl::StatusOr<bool> IsOpen(Collection& collection, const UploadName& upload) {
  const auto scene = collection.store.scenes().GetScene(upload.scene);
  if (absl::IsNotFound(scene.status())) return false;
  RETURN_IF_ERROR(scene.status());
  if (scene->scene.project != upload.scene.project) return false;
  const auto record = collection.store.datasets().GetDataset(scene->scene, upload.number);
  if (absl::IsNotFound(record.status())) return false;
  RETURN_IF_ERROR(record.status());
  return record->state == DatasetState::kOpen;
}

// Returns the blobs on the disk that are at least options.file_age old.
std::vector<fs::path> OldBlobs(const Collection& collection, const fs::path& project) {
  std::vector<fs::path> old;
  for (const fs::path& folder : EntriesOf(project)) {
    for (const fs::path& blob : EntriesOf(folder)) {
      if (IsDigest(blob) && AgeOf(blob) >= collection.options.file_age) old.push_back(blob);
    }
  }
  return old;
}

void EraseNamed(const std::set<std::string>& digests, std::vector<fs::path>& blobs) {
  std::erase_if(blobs,
                [&](const fs::path& blob) { return digests.contains(blob.filename().string()); });
}

// Returns the blobs of a project that no dataset or upload names. Blobs that the store counts are
// included whatever their age, since what named them was deleted. Others only if they are old,
// since an upload may be about to name them.
absl::StatusOr<std::vector<fs::path>> UnnamedBlobs(const Collection& collection,
                                                   const std::string& project) {
  const fs::path& data = collection.options.data;
  std::vector<fs::path> blobs = OldBlobs(collection, BlobFolderOf(data, project));
  ASSIGN_OR_RETURN(const std::set<std::string> counted,
                   collection.store.files().ListBlobs(project));
  for (const std::string& digest : counted) blobs.push_back(BlobPath(data, {project, digest}));
  if (blobs.empty()) return blobs;
  ASSIGN_OR_RETURN(const std::set<std::string> digests,
                   collection.store.files().ListDigests(project));
  EraseNamed(digests, blobs);
  return blobs;
}

absl::Status CollectBlobsOf(Collection& collection, const std::string& project) {
  ASSIGN_OR_RETURN(std::vector<fs::path> blobs, UnnamedBlobs(collection, project));
  if (blobs.empty()) return absl::OkStatus();
  // Uploads hold the shared lock while they look for blobs (BlobStore::Hold). With the exclusive
  // lock, look again: what is unnamed now stays so until it is removed.
  ASSIGN_OR_RETURN(const LockedFile alone,
                   LockedFile::WaitAlone(BlobLockPath(collection.options.data, project)));
  ASSIGN_OR_RETURN(blobs, UnnamedBlobs(collection, project));
  std::vector<std::string> gone;
  for (const fs::path& blob : blobs) {
    collection.Remove(blob);
    std::error_code error;
    // Only blobs that are gone leave the quota. One that could not be removed is tried again next
    // time.
    if (!fs::exists(blob, error) && !error) gone.push_back(blob.filename().string());
  }
  return collection.store.files().ForgetBlobs(project, gone);
}

}  // namespace

void Collection::Remove(const fs::path& file) {
  std::error_code error;
  const auto size = fs::file_size(file, error);
  const int64_t bytes = error ? 0 : static_cast<int64_t>(size);
  if (!fs::remove(file, error) || error) return;
  ++collected.num_files;
  collected.num_bytes += bytes;
}

void Collection::RemoveAll(const fs::path& folder) {
  const Collected all = MeasureFolder(folder);
  // Follows no symbolic links: workers can write to these folders.
  if (!RemoveBeneath(folder.parent_path(), folder.filename()).ok()) return;
  collected.num_files += all.num_files;
  collected.num_bytes += all.num_bytes;
}

std::vector<fs::path> EntriesOf(const fs::path& folder) {
  std::vector<fs::path> entries;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    entries.push_back(entry->path());
  }
  return entries;
}

absl::Duration AgeOf(const fs::path& path) {
  std::error_code error;
  const fs::file_time_type written = fs::last_write_time(path, error);
  // A file whose age is unknown counts as new, and stays.
  if (error) return absl::ZeroDuration();
  return absl::FromChrono(fs::file_time_type::clock::now() - written);
}

Collected MeasureFolder(const fs::path& folder) {
  Collected sum;
  const absl::StatusOr<BeneathFolder> top = BeneathFolder::Open(folder);
  if (!top.ok()) return sum;
  VisitFiles(*top, [&](const BeneathFolder& where, const std::string& name) {
    const auto facts = where.Look(name);
    if (!facts) return;
    ++sum.num_files;
    sum.num_bytes += facts->num_bytes;
  });
  return sum;
}

void CollectTemporaries(Collection& collection) {
  const CollectorOptions& options = collection.options;
  // The kernel stamps files with a clock that lags behind by up to one tick.
  constexpr absl::Duration kCoarse = absl::Milliseconds(20);
  const absl::Time now = absl::Now();
  const absl::Duration since_start = now - collection.collector_made + kCoarse;
  // A server that is alone on the directory knows that temporary files from before its start have
  // no writer. Those under jobs/ may be of workers that outlived a server.
  const absl::Duration alone =
      options.alone ? std::min(since_start, options.file_age) : options.file_age;
  const absl::StatusOr<BeneathFolder> data = BeneathFolder::Open(options.data);
  const auto entries = data.ok() ? data->List() : data.status();
  if (!entries.ok()) return;
  const std::string jobs = JobsFolder("").string();
  for (const BeneathFolder::Entry& entry : *entries) {
    const absl::Duration age = entry.name == jobs ? options.file_age : alone;
    const auto visit = [&](const BeneathFolder& where, const std::string& name) {
      // The form of names that WriteFileAtomically gives to files before it renames them.
      if (!absl::StrContains(name, ".tmp-")) return;
      const auto facts = where.Look(name);
      if (!facts || now - facts->modified < age || !where.RemoveAll(name).ok()) return;
      ++collection.collected.num_files;
      collection.collected.num_bytes += facts->num_bytes;
    };
    if (entry.is_file) visit(*data, entry.name);
    const auto below = data->OpenFolder(entry.name);
    if (entry.is_folder && below.ok()) VisitFiles(*below, visit);
  }
}

absl::Status CollectUploads(Collection& collection) {
  const absl::Time before = absl::Now() - collection.options.upload_age;
  ASSIGN_OR_RETURN(const auto uploads, collection.store.datasets().ListOpenUploads(before));
  for (const DatasetRecord& record : uploads) RETURN_IF_ERROR(CollectUpload(collection, record));
  return absl::OkStatus();
}

absl::Status CollectPartial(Collection& collection) {
  for (const fs::path& project : EntriesOf(PartialFolder(collection.options.data))) {
    for (const fs::path& folder : EntriesOf(project)) {
      const UploadName upload = UploadOf(folder);
      if (upload.number == 0) continue;
      ASSIGN_OR_RETURN(const bool open, IsOpen(collection, upload));
      // Sealed, deleted, or of a scene that another project has created again.
      if (!open) RemovePartialFiles(collection, folder);
    }
  }
  return absl::OkStatus();
}

void CollectDamaged(Collection& collection) {
  for (const fs::path& project : EntriesOf(DamagedFolder(collection.options.data))) {
    for (const fs::path& blob : EntriesOf(project)) {
      if (AgeOf(blob) >= collection.options.file_age) collection.Remove(blob);
    }
    std::error_code ignored;
    fs::remove(project, ignored);  // fails unless it is empty
  }
}

absl::Status CollectBlobs(Collection& collection) {
  ASSIGN_OR_RETURN(const std::vector<std::string> counted,
                   collection.store.files().ListBlobProjects());
  std::set<std::string> projects(counted.begin(), counted.end());
  for (const fs::path& folder : EntriesOf(BlobFolder(collection.options.data))) {
    projects.insert(folder.filename().string());
  }
  for (const std::string& project : projects) RETURN_IF_ERROR(CollectBlobsOf(collection, project));
  return absl::OkStatus();
}

}  // namespace pepeseg
