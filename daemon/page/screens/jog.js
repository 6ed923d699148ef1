// The cell with the drawer that moves the arm open: an address of its own, for links and bookmarks.
import { html } from '../vendor/preact.js';
import { Cell } from './cell.js';

export const Jog = () => html`<${Cell} moving />`;
