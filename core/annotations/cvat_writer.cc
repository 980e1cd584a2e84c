#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/annotations/format_writers.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

// Values of attributes that are numbers: the least, the largest, the step.
constexpr std::array<int, 3> kNumbers = {1, 1'000'000, 1};
constexpr std::array<const char*, 2> kAttributes = {"instance_id", "track_id"};

// Returns a text as XML has it. Control characters, which XML cannot have, become spaces.
std::string XmlText(const std::string& text) {
  std::string xml;
  for (const char c : text) {
    switch (c) {
      case '&':
        xml += "&amp;";
        break;
      case '<':
        xml += "&lt;";
        break;
      case '>':
        xml += "&gt;";
        break;
      case '"':
        xml += "&quot;";
        break;
      default:
        xml.push_back(static_cast<unsigned char>(c) < ' ' ? ' ' : c);
    }
  }
  return xml;
}

// Returns a colour that differs from those of the neighbouring indices: hues in steps of the golden
// ratio.
std::string ColorOf(size_t index) {
  const double hue = 6 * std::fmod(0.618033988749895 * static_cast<double>(index), 1);
  const auto channel = [&](double offset) {
    const double at = std::fmod(offset + hue, 6);
    return static_cast<int>(
        std::lround(255 * (1 - 0.8 * std::clamp(std::min(at, 4 - at), 0., 1.))));
  };
  return absl::StrFormat("#%02x%02x%02x", channel(5), channel(3), channel(1));
}

// Returns the lengths of the runs of 0 and 1 in the box around a mask, by scanlines, beginning with
// a run of 0.
std::string RunsIn(const MaskExtent& box, const BinaryMask& mask, const RasterSize& size) {
  std::vector<int64_t> runs = {0};
  for (int y = box.y; y < box.y + box.height; ++y) {
    for (int x = box.x; x < box.x + box.width; ++x) {
      const bool inside = mask.pixels[static_cast<size_t>(y) * size.width + x] != 0;
      if (inside != (runs.size() % 2 == 0)) runs.push_back(0);
      ++runs.back();
    }
  }
  return absl::StrJoin(runs, ", ");
}

class CvatWriter final : public AnnotationWriter {
 public:
  CvatWriter(const AnnotatedScene& scene, ZipWriter& zip)
      : scene_(scene), zip_(zip), categories_(CategoriesOf(scene.things)) {}

  absl::Status Add(const AnnotatedView& view) override {
    absl::StrAppend(&images_, "  <image id=\"", view.index, "\" name=\"",
                    XmlText(scene_.views[view.index]), "\" width=\"", view.size.width,
                    "\" height=\"", view.size.height, "\">\n");
    for (size_t t = 0; t < scene_.things.size(); ++t) {
      if (ShowNothing(view.counts[t], view.size)) continue;
      const AnnotatedThing& thing = scene_.things[t];
      ASSIGN_OR_RETURN(const BinaryMask mask, MaskOfCounts(view.counts[t], view.size));
      const MaskExtent box = ExtentOf(mask, view.size);
      if (box.area == 0) continue;
      absl::StrAppend(&images_, "    <mask label=\"", XmlText(thing.category),
                      "\" source=\"semi-auto\" occluded=\"0\" rle=\"", RunsIn(box, mask, view.size),
                      "\" left=\"", box.x, "\" top=\"", box.y);
      absl::StrAppend(&images_, "\" width=\"", box.width, "\" height=\"", box.height,
                      "\" z_order=\"0\">\n      <attribute name=\"instance_id\">", thing.instance,
                      "</attribute>\n      <attribute name=\"track_id\">", thing.track,
                      "</attribute>\n    </mask>\n");
    }
    images_ += "  </image>\n";
    return absl::OkStatus();
  }

  absl::Status Finish() override {
    RETURN_IF_ERROR(zip_.Add("annotations.xml",
                             absl::StrCat("<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
                                          "<annotations>\n  <version>1.1</version>\n",
                                          Meta(), images_, "</annotations>\n"),
                             ZipWriter::Method::kDeflated));
    return zip_.Add("labels.json", LabelsJson(), ZipWriter::Method::kDeflated);
  }

  int64_t num_waiting_bytes() const override { return 2 * static_cast<int64_t>(images_.size()); }

 private:
  std::string Meta() const {
    std::string meta = absl::StrCat(
        "  <meta>\n    <task>\n      <name>", XmlText(scene_.name), "</name>\n      <size>",
        scene_.views.size(),
        "</size>\n      <mode>annotation</mode>\n      <overlap>0</overlap>\n      <labels>\n");
    for (size_t i = 0; i < categories_.size(); ++i) {
      absl::StrAppend(&meta, "        <label>\n          <name>", XmlText(categories_[i]),
                      "</name>\n          <color>", ColorOf(i),
                      "</color>\n          <type>any</type>\n          <attributes>\n");
      for (const char* const name : kAttributes) {
        absl::StrAppend(&meta, "            <attribute>\n              <name>", name,
                        "</name>\n              <mutable>False</mutable>\n"
                        "              <input_type>number</input_type>\n"
                        "              <default_value>",
                        kNumbers[0], "</default_value>\n              <values>",
                        absl::StrJoin(kNumbers, "\n"), "</values>\n            </attribute>\n");
      }
      meta += "          </attributes>\n        </label>\n";
    }
    return meta + "      </labels>\n    </task>\n  </meta>\n";
  }

  // Returns the labels as the raw form of CVAT's editor of labels.
  std::string LabelsJson() const {
    nlohmann::ordered_json labels = nlohmann::ordered_json::array();
    for (size_t i = 0; i < categories_.size(); ++i) {
      nlohmann::ordered_json attributes = nlohmann::ordered_json::array();
      for (const char* const name : kAttributes) {
        nlohmann::ordered_json values = nlohmann::ordered_json::array();
        for (const int number : kNumbers) values.push_back(absl::StrCat(number));
        attributes.push_back({{"name", name},
                              {"mutable", false},
                              {"input_type", "number"},
                              {"default_value", absl::StrCat(kNumbers[0])},
                              {"values", values}});
      }
      labels.push_back({{"name", categories_[i]},
                        {"color", ColorOf(i)},
                        {"type", "any"},
                        {"attributes", attributes}});
    }
    return TextOf(labels);
  }

  const AnnotatedScene& scene_;
  ZipWriter& zip_;
  const std::vector<std::string> categories_;
  std::string images_;
};

}  // namespace

std::unique_ptr<AnnotationWriter> MakeCvatWriter(const AnnotatedScene& scene, ZipWriter& zip) {
  return std::make_unique<CvatWriter>(scene, zip);
}

}  // namespace pepeseg
