#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "core/annotations/annotation_writer.h"

// The writers of the formats, each in a file named after it. The scene and the zip must outlive a
// writer.
namespace pepeseg {

std::unique_ptr<AnnotationWriter> MakeCocoWriter(const AnnotatedScene& scene, ZipWriter& zip);
std::unique_ptr<AnnotationWriter> MakeYoloWriter(const AnnotatedScene& scene, ZipWriter& zip);
std::unique_ptr<AnnotationWriter> MakeLabelMeWriter(const AnnotatedScene& scene, ZipWriter& zip);
std::unique_ptr<AnnotationWriter> MakeCvatWriter(const AnnotatedScene& scene, ZipWriter& zip);
// In mask_writers.cc.
std::unique_ptr<AnnotationWriter> MakeMaskWriter(const AnnotatedScene& scene, ZipWriter& zip);
std::unique_ptr<AnnotationWriter> MakeIdWriter(const AnnotatedScene& scene, ZipWriter& zip);

// Returns the text of a document. Bytes that are not UTF-8 are replaced.
std::string TextOf(const nlohmann::ordered_json& json);

}  // namespace pepeseg
