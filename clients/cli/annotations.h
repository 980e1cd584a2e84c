#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "clients/cli/verbs.h"
#include "clients/terminal/shell.h"

// The part of the verb "export" that fetches the masks of labels for annotation tools.
namespace pepeseg::client::cli {

struct AnnotationFlags {
  std::vector<std::string> labels;  // ids; empty: all
  int level = -1;                   // of segments in place of labels; -1: labels
  std::vector<std::string> views;   // names, "all" or "held-out"; empty: all
  bool sam_borders = true;          // let SAM place the borders where it suits the model
  std::string table;                // file to write; empty: none
};
void AddAnnotationFlags(CLI::App& verb, AnnotationFlags& flags);

// Returns the words of --format that name formats of annotations.
std::vector<std::string> AnnotationFormats();

// Fetches the masks and writes them: a zip if `file` ends in .zip, else one file for coco and a
// folder for the others. Prints what it wrote. model: resource name; scales: of the decomposition
// that has the segments. INVALID_ARGUMENT: no such format.
absl::Status FetchAnnotations(const Shell& shell, const std::string& model,
                              const std::string& format, const std::string& file,
                              const AnnotationFlags& flags, const std::vector<double>& scales);

}  // namespace pepeseg::client::cli
