using Handcal;
using UnityEngine;

/// <summary>Asks for the PC's address and digits, or the text under its QR code.</summary>
public sealed class PairByTyping : MonoBehaviour
{
    public HandcalHeadset headset;
    TouchScreenKeyboard keyboard;

    /// <summary>Opens the keyboard: call it from a button or a voice command.</summary>
    public void Ask()
    {
        keyboard = TouchScreenKeyboard.Open("");
    }

    void Update()
    {
        if (keyboard == null || keyboard.status != TouchScreenKeyboard.Status.Done) return;
        if (headset.Pair(keyboard.text)) enabled = false;
        keyboard = null;
    }
}
