#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/cpp/resource_names.h"
#include "pepeseg/v1/evaluation_service.pb.h"
#include "pepeseg/v1/prompt.pb.h"
#include "pepeseg/v1/render_service.pb.h"
#include "pepeseg/v1/segmentation_service.pb.h"

// Flags that several verbs share, and the parts of a request that they become. Each Add function
// adds flags to a verb; parsing the command line fills the struct, which must outlive the parser.
namespace pepeseg::client::cli {

// Parses a point "120,88.5" and a box "10,20,100,80". INVALID_ARGUMENT: it is malformed.
absl::StatusOr<v1::PointsPrompt::Point> ParsePoint(const std::string& text, bool negative);
absl::StatusOr<v1::BoxPrompt> ParseBox(const std::string& text);

// Adds --frame photograph|view: the image whose pixels points, boxes, masks and pictures are in.
// Sets `frame` to its default, photograph.
CLI::Option* AddFrameFlag(CLI::App& verb, v1::PixelFrame& frame);

// Reads the names that one value of an option has: those in a text file, one a line, if there is a
// file of that name, otherwise the value's parts between commas. Empty names are dropped. A file
// with a zero byte, such as a photograph, is not text: its own name is meant.
std::vector<std::string> ReadNames(const std::string& value);
// Adds an option of names, which may be repeated; each value is read by ReadNames. `help` says what
// the names are of, and how the option reads them is added to it.
CLI::Option* AddNamesFlag(CLI::App& verb, const std::string& flag, std::vector<std::string>& names,
                          const std::string& help);

// A prompt: what is pointed at, in which view of which model.
struct PromptFlags {
  std::string scene;
  std::string model = "live";
  std::string view;
  std::vector<std::string> positive;                  // "X,Y" each
  std::vector<std::string> negative;                  // "X,Y" each
  std::string box, mask, label;                       // instead of points; see AddAnyPromptFlags
  v1::PixelFrame frame = v1::PIXEL_FRAME_PHOTOGRAPH;  // of points, box and mask, and of the answer
};
// Adds flags for a prompt of points.
void AddPromptFlags(CLI::App& verb, PromptFlags& flags);
// Adds flags for a prompt of points, a box, a mask or a label; the user must give exactly one.
void AddAnyPromptFlags(CLI::App& verb, PromptFlags& flags);
// Returns the prompt. INVALID_ARGUMENT: a point or a box is malformed. LocalFileError: the file of
// the mask cannot be read.
absl::StatusOr<v1::Prompt> ParsePrompt(const PromptFlags& flags);

// How large a thing is meant, and how similar its pixels must be.
struct GranularityFlags {
  double scale = -1;      // quantile, [0, 1]; below 0: the server chooses
  double units = 0;       // instead of `scale`: scene units; 0: not given
  double threshold = -2;  // cosine, [-1, 1]; below -1: the server chooses
};
void AddGranularityFlags(CLI::App& verb, GranularityFlags& flags);
v1::Granularity ToGranularity(const GranularityFlags& flags);

// Returns "part", "object" or "group"; "" for another kind of proposal.
std::string KindName(v1::ProposeScalesResponse::Kind kind);

// Returns the protocols of an evaluation by the values of --protocol, such as "label-propagation".
const std::map<std::string, v1::EvaluationProtocol>& ProtocolsByName();
// Returns the value of --protocol for a protocol.
std::string ProtocolName(v1::EvaluationProtocol protocol);

// Adds --scales: the scales of a decomposition.
void AddScalesFlag(CLI::App& verb, std::vector<double>& scales);

// A subset of a model's Gaussians; by default all of them.
struct SubsetFlags {
  int selection = 0;           // number of a selection; 0: none
  std::string segment;         // "LEVEL:ID"; empty: none
  std::vector<double> scales;  // of the decomposition that has the segment; empty: the server's
  bool without = false;        // all other Gaussians instead
};
void AddSubsetFlags(CLI::App& verb, SubsetFlags& flags);
// Returns the subset of a model of `scene`. INVALID_ARGUMENT: the segment is not LEVEL:ID, or
// --without is given without a selection or a segment.
absl::StatusOr<v1::Subset> ParseSubset(const SubsetFlags& flags, const std::string& scene);

}  // namespace pepeseg::client::cli
