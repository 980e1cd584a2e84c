#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "clients/terminal/picture.h"
#include "pepeseg/v1/prompt.pb.h"

// Outlines of things that people drew on photographs, and masks of them.
namespace pepeseg::client::cli {

// Returns the rectangle with two opposite corners, and a circle through a point as a polygon.
Polygon BoxOf(const OutlinePoint& corner, const OutlinePoint& opposite);
Polygon CircleOf(const OutlinePoint& centre, const OutlinePoint& point);

// A region of a photograph.
struct OutlineRegion {
  // The region is the union of these polygons, as COCO's own code has it. One that lies wholly
  // inside another, and does not touch its border, is a hole in it; one inside of that hole is an
  // island.
  std::vector<Polygon> polygons;
  std::optional<v1::CocoRle> rle;  // in place of polygons
};

// A thing in a photograph: the union of its regions.
struct OutlinedEntity {
  std::string name;
  std::vector<OutlineRegion> regions;
};

// The outlines of a photograph.
struct OutlinedPhotograph {
  std::string name;            // as the tool has it: "a.jpg", or "a" of LabelMe's a.json
  std::filesystem::path file;  // that has the outlines
  PixelSize size;              // of the image that was drawn on
  std::vector<OutlinedEntity> entities;
};

// Returns the outlines of a view's photograph, by its name without ending and images/; null if
// there are none.
const OutlinedPhotograph* OutlinesOf(const std::vector<OutlinedPhotograph>& photographs,
                                     const std::string& view);

// Returns the photographs that are not among the views, by their names as OutlinesOf compares them.
std::vector<const OutlinedPhotograph*> PhotographsNotIn(
    const std::vector<std::string>& views, const std::vector<OutlinedPhotograph>& photographs);

// Returns the entity's mask, 0 or 1, in an image of `size` pixels, which has the shape of
// `drawn_on`, the size of the image that was drawn on.
GreyPicture MaskOfEntity(const OutlinedEntity& entity, const PixelSize& drawn_on,
                         const PixelSize& size);

}  // namespace pepeseg::client::cli
