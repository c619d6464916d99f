"""Parts of the fine-tune panel: φ edited, undone, streamed."""
