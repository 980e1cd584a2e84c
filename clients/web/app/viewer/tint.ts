/** Factors of red, green and blue, which leave light and dark. */
export type Tint = readonly [red: number, green: number, blue: number];

/** The tint of what is selected or picked. */
export const selectionTint: Tint = [0.25, 1.35, 1.2];
