#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/annotations/things.h"
#include "core/formats/zip_writer.h"

// Writes labelled masks as the files of annotation tools. The formats are described in
// proto/pepeseg/v1/label_service.proto, AnnotationFormat.
namespace pepeseg {

enum class AnnotationFormat { kCoco, kYolo, kLabelMe, kMasks, kCvat, kIds };

// Writes the files of one format into a zip.
class AnnotationWriter {
 public:
  virtual ~AnnotationWriter() = default;

  // Adds the masks of a view. Each view of the scene is added once, in order. INVALID_ARGUMENT: a
  // mask is malformed. Other errors are those of the zip.
  virtual absl::Status Add(const AnnotatedView& view) = 0;
  // Writes what is of all views. Call it once, last.
  virtual absl::Status Finish() = 0;
  // Returns the bytes that wait for Finish, about.
  virtual int64_t num_waiting_bytes() const { return 0; }
};

// Returns the writer of a format. The scene and the zip must outlive it.
std::unique_ptr<AnnotationWriter> MakeAnnotationWriter(AnnotationFormat format,
                                                       const AnnotatedScene& scene, ZipWriter& zip);

// Returns the path of a file for each view: its name with `suffix` for its own, folders included.
// Views that differ in their suffix only keep it. A name that leads out of a folder is flattened.
std::vector<std::string> FilesOfViews(const AnnotatedScene& scene, const std::string& suffix);

// Returns the things as JSON, for the files next to masks that have only numbers or names.
std::string ThingsJson(const AnnotatedScene& scene);

}  // namespace pepeseg
