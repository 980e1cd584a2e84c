// Masks as COCO's JSON of instances: pycocotools and annotation tools read it.
import type { Rle } from './rle';

export interface ViewMasks {
  /** Id of the label, which is a folder's name, unlike its text. */
  readonly id: string;
  /** Text of the label, for people. */
  readonly category: string;
  readonly masks: readonly {
    view: string;
    rle: Rle;
    area: number;
    box: readonly number[];
    score: number;
  }[];
}

export interface CocoView {
  readonly view: string;
  readonly width: number;
  readonly height: number;
}

export function cocoJson(
  scene: string,
  views: readonly CocoView[],
  segments: readonly ViewMasks[],
): object {
  const images = views.map(({ view, width, height }, i) => ({
    id: i + 1,
    file_name: view,
    width,
    height,
  }));
  const imageIds = new Map(images.map(({ id, file_name }) => [file_name, id]));
  const categories = segments.map(({ category }, i) => ({
    id: i + 1,
    name: category,
    supercategory: '',
  }));
  const found = segments.flatMap(({ masks }, category) =>
    masks
      .filter(({ view, area }) => area > 0 && imageIds.has(view))
      .map(({ view, rle, area, box, score }) => ({
        image_id: imageIds.get(view),
        category_id: category + 1,
        segmentation: { size: [rle.height, rle.width], counts: rle.counts },
        area,
        bbox: box,
        iscrowd: 0,
        score,
      })),
  );
  const annotations = found.map((annotation, i) => ({ id: i + 1, ...annotation }));
  return { info: { description: `pepeseg: ${scene}` }, images, categories, annotations };
}
